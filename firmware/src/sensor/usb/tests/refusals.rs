use super::*;

fn stands(acts: Vec<(u64, Act)>, ms: u64) -> Vec<(Option<Model>, Option<Trouble>)> {
    run(&World::begin(acts), ANY, ms, never).stands
}

fn words(trouble: Trouble) -> String {
    trouble.to_string()
}

#[test]
fn another_device_is_refused_by_its_numbers_and_a_camera_behind_it_is_taken() {
    let device = [18, 1, 0, 2, 0, 0, 0, 8, 0x6d, 0x04, 0x2b, 0xc5, 0x10, 0x24, 1, 2, 0, 1];
    let configuration =
        vec![9, 2, 25, 0, 1, 1, 0, 0xa0, 49, 9, 4, 0, 0, 1, 3, 1, 2, 0, 7, 5, 0x81, 3, 8, 0, 10];
    // A mouse.
    let mouse = Device::Other { device, configuration };
    let camera = Camera::new(Model::Davis346, vec![]);
    let foreign = Trouble::Foreign { vendor_id: 0x046d, product_id: 0xc52b };
    let acts = vec![(0, Act::Plug(mouse, Speed::Low)), (3_000, Act::Unplug), (3_100, plug(camera))];
    let port = World::begin(acts);
    let heard = run(&port, ANY, 6_000, |now, _| now.camera.is_some());
    assert_eq!(
        heard.stands,
        [(None, None), (None, Some(foreign)), (None, None), (Some(Model::Davis346), None)]
    );
    assert_eq!(port.0.borrow().resets, 0, "it will not become a camera by being asked again");
    assert!(words(foreign).starts_with("046d:c52b is no camera known here"), "{foreign}");
}

#[test]
fn old_firmware_and_other_logic_are_named_with_what_is_needed() {
    for model in Model::ALL {
        let needs = model.oldest_firmware();
        let mut camera = Camera::new(model, vec![]);
        camera.firmware = needs - 1;
        let old = Trouble::OldFirmware { model, has: needs - 1, needs };
        assert_eq!(stands(vec![(0, plug(camera))], 300), [(None, None), (None, Some(old))]);
        let text = words(old);
        assert!(text.contains(model.name()) && text.contains(&format!("{needs}")), "{text}");

        for (version, patch) in [(17, 9), (19, 1), (18, model.oldest_patch() - 1)] {
            let mut camera = Camera::new(model, vec![]);
            camera.set(Register::new(Module::System, 0), version);
            camera.set(Register::new(Module::System, 7), patch);
            let other = Trouble::OtherLogic { model, version, patch };
            assert_eq!(stands(vec![(0, plug(camera))], 300), [(None, None), (None, Some(other))]);
            assert!(words(other).contains(&format!("{version}.{patch}")));
        }
    }
}

#[test]
fn a_camera_at_full_speed_is_told_what_it_lacks() {
    let camera = Device::Camera(Box::new(Camera::new(Model::Davis346, vec![])));
    assert_eq!(
        stands(vec![(0, Act::Plug(camera, Speed::Full))], 300),
        [(None, None), (None, Some(Trouble::Slow))]
    );
}

#[test]
fn sizes_and_clocks_that_make_no_sense_are_refused() {
    for (register, value) in [
        (Register::new(Module::Dvs, 0), 0),
        (Register::new(Module::Dvs, 1), 70_000),
        (Register::new(Module::System, 5), 0),
        (Register::new(Module::System, 6), 0xffff_ffff),
    ] {
        let mut camera = Camera::new(Model::Davis346, vec![]);
        camera.set(register, value);
        let heard = stands(vec![(0, plug(camera))], 1_000);
        assert!(matches!(heard[1], (None, Some(Trouble::Nonsense(_)))), "{register}: {heard:?}");
    }
}

#[test]
fn what_does_not_answer_is_asked_again_and_found_when_it_does() {
    let silent = Device::Other { device: [0; 18], configuration: vec![] };
    let camera = Camera::new(Model::Dvxplorer, vec![]);
    let port = World::begin(vec![
        (0, Act::Plug(silent, Speed::High)),
        (1_000, Act::Unplug),
        (1_100, plug(camera)),
    ]);
    let heard = run(&port, ANY, 6_000, |now, _| now.camera.is_some());
    assert_eq!(heard.stands[1], (None, Some(Trouble::NoAnswer)));
    assert_eq!(heard.stands.last(), Some(&(Some(Model::Dvxplorer), None)));
}

#[test]
fn addresses_and_pipes_come_back() {
    let silent = Device::Other { device: [0; 18], configuration: vec![] };
    let mut acts = vec![(0, Act::Plug(silent, Speed::High))];
    acts.extend(
        (1..40).map(|turn| (turn * 20, if turn % 2 == 1 { Act::Unplug } else { Act::Replug })),
    );
    acts.push((2_000, Act::Unplug));
    acts.push((2_010, plug(Camera::new(Model::Davis346, vec![]))));
    let port = World::begin(acts);
    run(&port, ANY, 5_000, |now, _| now.camera.is_some());
    let world = port.0.borrow();
    assert_eq!(world.addresses.last(), Some(&1), "{:?}", world.addresses);
    assert_eq!(world.pipes, 0, "with nobody left to read");
}

#[test]
fn every_trouble_ends_with_what_to_do() {
    let register = Register::new(Module::Chip, 0x3300);
    for trouble in [
        Trouble::Foreign { vendor_id: 0xffff, product_id: 0xffff },
        Trouble::OldFirmware { model: Model::Dvxplorer, has: 255, needs: 255 },
        Trouble::OtherLogic { model: Model::Dvxplorer, version: 99, patch: 99 },
        Trouble::Slow,
        Trouble::NoData,
        Trouble::NoAnswer,
        Trouble::Register(register),
        Trouble::Nonsense(register),
        Trouble::Stalled,
        Trouble::Damaged,
        Trouble::Overcurrent,
    ] {
        let text = words(trouble);
        let (_, advice) = text.rsplit_once(": ").expect("advice");
        assert!(
            ["plug", "update", "use", "check"].iter().any(|verb| advice.starts_with(verb)),
            "{text}"
        );
        assert!(text.len() <= TROUBLE_BYTES, "{text}");
    }
}
