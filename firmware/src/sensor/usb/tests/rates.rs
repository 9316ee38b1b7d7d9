use super::*;

/// Every event that the camera saw is somewhere.
fn closes(heard: &Heard, world: &World) {
    let camera = world.camera().expect("a camera");
    let acquired = &heard.acquired;
    assert_eq!(acquired.delivered.used(), heard.events.len() as u64);
    assert_eq!(acquired.lost_by_camera, camera.dropped, "{acquired}");
    assert_eq!(
        acquired.delivered.received + camera.dropped + camera.filtered,
        camera.seen,
        "{acquired}"
    );
    // A block that finds no place tells with the next one that does.
    let told = acquired.delivered.overrun + acquired.lost_by_camera;
    assert!(heard.lost <= told, "{} of {told}", heard.lost);
}

/// Counters are asked ten times a second: long enough behind the last event.
fn settled(acquired: &Acquired, world: &World) -> bool {
    world
        .camera()
        .is_some_and(|camera| camera.is_done() && camera.dropped == acquired.lost_by_camera)
}

#[test]
fn what_the_fifo_cannot_hold_is_counted_by_the_camera_and_told() {
    // Two million events in 20 ms, many times what the FIFO holds between two looks at it.
    let mut burst = events(Model::Davis346, 2_000_000, 100_000_000);
    burst.push(Event { t_us: 200_000, x: 0, y: 0, polarity: Polarity::On });
    let port = World::begin(vec![(0, plug(Camera::new(Model::Davis346, burst)))]);
    let heard = run(&port, ANY, 6_000, settled);
    assert!(heard.acquired.lost_by_camera > 100_000, "{}", heard.acquired);
    closes(&heard, &port.0.borrow());
}

#[test]
fn more_than_the_instrument_can_use_is_left_out_by_the_camera_and_counted() {
    let seen = events(Model::Davis346, 400_000, 400_000);
    let port = World::begin(vec![(0, plug(Camera::new(Model::Davis346, seen)))]);
    let heard = run(&port, 240_000, 9_000, settled);
    let world = port.0.borrow();
    let camera = world.camera().expect("a camera");
    assert!(
        heard.acquired.limit.skips && heard.acquired.limit.region.is_none(),
        "{:?}",
        heard.acquired.limit
    );
    assert_eq!(camera.filters().skip_every, Some(1));
    closes(&heard, &world);
    // One for one: off by what waited in the FIFO when the filter was set, 32 KB at most.
    let counted = heard.acquired.thinned_by_camera;
    assert!(camera.filtered.abs_diff(counted) < 8_192, "{counted} of {}", camera.filtered);
    assert!(camera.filtered > 100_000);
}

#[test]
fn far_more_than_that_narrows_the_view_and_a_calm_widens_it_again() {
    let mut seen = events(Model::Davis346, 400_000, 800_000);
    let calm = events(Model::Davis346, 12_000, 1_000);
    seen.extend(calm.into_iter().map(|event| Event { t_us: event.t_us + 600_000, ..event }));
    let port = World::begin(vec![(0, plug(Camera::new(Model::Davis346, seen)))]);
    let narrowest = core::cell::Cell::new(u32::MAX);
    let heard = run(&port, 100_000, 14_000, |now, world| {
        let area =
            |limit: Limit| limit.region.map(|r| u32::from(r.width_px) * u32::from(r.height_px));
        narrowest.set(narrowest.get().min(area(now.limit).unwrap_or(u32::MAX)));
        now.latest_us > 1_000_000 && !now.limit.is_on() || settled(now, world)
    });
    assert_eq!(narrowest.get(), 173 * 130, "a quarter of the sensor");
    assert!(!heard.acquired.limit.is_on(), "{}", heard.acquired);
    let world = port.0.borrow();
    let camera = world.camera().expect("a camera");
    assert_eq!(camera.filters().skip_every, None);
    assert_eq!(camera.filters().region.map(|region| region.width_px), Some(346));
}

#[test]
fn a_dvxplorer_narrows_its_view_by_its_own_registers() {
    let seen = events(Model::Dvxplorer, 400_000, 400_000);
    let port = World::begin(vec![(0, plug(Camera::new(Model::Dvxplorer, seen)))]);
    let heard = run(&port, 200_000, 6_000, settled);
    let region = heard.acquired.limit.region.expect("a region");
    assert!(!heard.acquired.limit.skips);
    assert!(region.width_px < 640 && region.height_px < 480);
    closes(&heard, &port.0.borrow());
    // Behind the change, only from there; rows go by eights.
    let last = &heard.events[heard.events.len() - 1_000..];
    assert!(last.iter().all(|event| (region.x..region.x + region.width_px).contains(&event.x)));
    let rows = region.y..(region.y + region.height_px).next_multiple_of(8);
    assert!(last.iter().all(|event| rows.contains(&event.y)));
}

#[test]
fn nobody_measures_and_acquiring_goes_on_thinned_and_none_is_lost() {
    let seen = events(Model::Davis346, 60_000, 200_000);
    let port = World::begin(vec![(0, plug(Camera::new(Model::Davis346, seen)))]);
    let state = Box::leak(Box::new(BusState::new()));
    let mut buffers = [const { Block::EMPTY }; BLOCKS];
    let mut channel = Channel::<NoopRawMutex, _>::new(&mut buffers);
    let (mut sender, mut receiver) = channel.split();
    let mut acquired = Acquired::NONE;
    let acquiring = acquire(port.clone(), state, &mut sender, ANY, |now| acquired = *now);
    let watching = async {
        while !port.0.borrow().camera().is_some_and(Camera::is_done) {
            Timer::after_millis(10).await;
        }
        Timer::after_millis(50).await;
    };
    match block_on(select(acquiring, watching)) {
        Either::First(never) => never,
        Either::Second(()) => {}
    }
    let mut heard = Heard { acquired, ..Heard::NOTHING };
    drain(&mut receiver, &mut heard);
    assert!(acquired.delivered.thinned > 0, "{acquired}");
    assert_eq!((acquired.delivered.received, acquired.delivered.overrun), (60_000, 0));
    // The last block waits to be full.
    let waiting = acquired.delivered.used() - heard.events.len() as u64;
    assert!(waiting < BLOCK_EVENTS as u64, "{waiting}");
}

#[test]
fn what_came_before_counts_neither_for_the_rate_nor_twice_for_the_losses() {
    // Half of it goes by in a burst that the FIFO cannot hold, then the camera is asked anew without losing power.
    let mut seen = events(Model::Davis346, 400_000, 100_000_000);
    let calm = events(Model::Davis346, 200_000, 100_000);
    seen.extend(calm.into_iter().map(|event| Event { t_us: event.t_us + 5_000, ..event }));
    let port = World::begin(vec![
        (0, plug(Camera::new(Model::Davis346, seen))),
        (1_500, Act::Fail(PipeError::Babble, 6)),
    ]);
    let heard = run(&port, 4_500_000, 12_000, |now, world| {
        world.camera().is_some_and(Camera::is_done) && now.sessions == 2
    });
    let world = port.0.borrow();
    let camera = world.camera().expect("a camera");
    assert_eq!(heard.acquired.sessions, 2);
    assert!(camera.dropped > 100_000);
    assert_eq!((camera.filtered, heard.acquired.limit), (0, Limit::NONE));
    assert!(heard.acquired.lost_by_camera <= camera.dropped, "{}", heard.acquired);
    assert!(heard.acquired.seen() <= camera.seen);
}
