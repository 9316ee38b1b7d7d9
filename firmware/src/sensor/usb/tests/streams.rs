use super::*;

#[test]
fn what_a_camera_sees_comes_whole_and_in_order() {
    for model in Model::ALL {
        let events = events(model, 40_000, 100_000);
        let port = World::begin(vec![(0, plug(Camera::new(model, events.clone())))]);
        let heard = run(&port, ANY, 5_000, all_sent);
        assert!(
            heard.events == events,
            "{model:?}: {} events, {}",
            heard.events.len(),
            heard.acquired
        );
        assert_eq!(heard.geometry, Some(model.geometry()));
        assert_eq!((heard.lost, heard.acquired.delivered.used()), (0, 40_000));
        assert_eq!((heard.acquired.seen(), heard.acquired.damaged_words), (40_000, 0));
        assert_eq!(heard.stands.last(), Some(&(Some(model), None)));
    }
}

#[test]
fn a_davis_that_lies_on_its_side_is_asked_and_believed() {
    let mut camera = Camera::new(Model::Davis346, vec![]);
    camera.set(Register::new(Module::Dvs, 2), 4);
    let heard = run(&World::begin(vec![(0, plug(camera))]), ANY, 2_000, |now, _| now.latest_us > 0);
    let geometry = heard.acquired.camera.map(|camera| camera.geometry);
    assert_eq!(geometry, Geometry::new(260, 346));

    let upright = Event { t_us: 5, x: 200, y: 300, polarity: Polarity::On };
    for model in Model::ALL {
        let mut camera = Camera::new(model, vec![upright]);
        camera.set(Register::new(Module::Dvs, 2), 4);
        let swapped = Event { x: 300, y: 200, ..upright };
        let heard = run(&World::begin(vec![(0, plug(camera))]), ANY, 2_000, all_sent);
        // The emulated DVXplorer sends its own columns as they are; the DAVIS turns what it sees.
        let expected = if model == Model::Davis346 { upright } else { swapped };
        assert_eq!(heard.events, [expected], "{model:?}");
    }
}

#[test]
fn the_gyro_is_left_on_and_its_samples_are_handed_on() {
    for (model, every_us) in [(Model::Davis346, 1_000), (Model::Dvxplorer, 1_250)] {
        for (flipped, sign) in [(0, 1.0), (1, -1.0)] {
            let mut camera = Camera::new(model, events(model, 20_000, 50_000));
            camera.roll_rad_s = 0.5;
            camera.set(Register::new(Module::Imu, 1), flipped);
            let heard = run(&World::begin(vec![(0, plug(camera))]), ANY, 5_000, all_sent);
            let samples = heard.gyro.len() as u64;
            let longest_us = 2 * 400_000;
            assert!((400_000..longest_us).contains(&(samples * every_us)), "{model:?}: {samples}");
            assert!(heard.gyro.iter().all(|sample| (sample.roll_rad_s - 0.5 * sign).abs() < 1e-3));
            let steps = heard.gyro.windows(2).map(|pair| pair[1].t_us - pair[0].t_us);
            assert!(steps.into_iter().all(|step_us| step_us == every_us), "{model:?}");
            assert_eq!((heard.events.len(), heard.acquired.damaged_words), (20_000, 0));
        }
    }
}

#[test]
fn clocks_that_wrap_or_begin_anew_go_on_forward() {
    for model in Model::ALL {
        // A pause over many wraps, and a reset some way behind it.
        let mut seen = events(model, 2_000, 100_000);
        seen.extend(
            events(model, 20_000, 100_000)
                .into_iter()
                .map(|event| Event { t_us: event.t_us + 250_000, ..event }),
        );
        let mut camera = Camera::new(model, seen.clone());
        camera.plan(9_000, Fault::ClockReset);
        let port = World::begin(vec![(0, plug(camera))]);
        let heard = run(&port, ANY, 5_000, all_sent);
        assert_eq!(heard.acquired.clock_resets, 1, "{model:?}");
        assert_eq!(heard.events.len(), seen.len());
        let mut jumps = 0;
        for (pair, sent) in heard.events.windows(2).zip(seen.windows(2)) {
            let step_us = pair[1].t_us.checked_sub(pair[0].t_us).expect("time goes forward");
            if step_us != sent[1].t_us - sent[0].t_us {
                jumps += 1;
                // From what was reached, which may be a sample of the gyro.
                assert!((3_000_000..=3_000_010).contains(&step_us), "{step_us}");
            }
        }
        assert_eq!(jumps, 1, "only where the clock was set to zero");
    }
}

#[test]
fn an_idle_camera_stays_and_costs_little() {
    // One without an inertial sensor, which would have something to say all the while.
    let mut camera = Camera::new(Model::Dvxplorer, vec![]);
    camera.set(Register::new(Module::Imu, 0), 0);
    let port = World::begin(vec![(0, plug(camera))]);
    let mut told = core::cell::Cell::new(0);
    let heard = run(&port, ANY, 2_500, |_, _| {
        told.set(told.get() + 1);
        false
    });
    assert_eq!(heard.stands, [(None, None), (Some(Model::Dvxplorer), None)]);
    assert_eq!(heard.acquired.errors, 0);
    assert!((4..12).contains(told.get_mut()), "{} looks in 2.5 s", told.get());
}
