use super::*;

/// 100 000 events a second, from about 370 ms after the camera was plugged in to well behind [`MIDDLE`].
fn seen() -> Vec<Event> {
    events(Model::Davis346, COUNT, 100_000)
}

const COUNT: u64 = 150_000;
const MIDDLE: u64 = 1_200;

fn camera() -> Camera {
    Camera::new(Model::Davis346, seen())
}

const THERE: (Option<Model>, Option<Trouble>) = (Some(Model::Davis346), None);
const NOBODY: (Option<Model>, Option<Trouble>) = (None, None);

const fn trouble(trouble: Trouble) -> (Option<Model>, Option<Trouble>) {
    (None, Some(trouble))
}

/// Events go forward, and are those that were seen, but for what was lost at one place.
fn one_gap(heard: &[Event]) {
    assert!(heard.windows(2).all(|pair| pair[0].t_us <= pair[1].t_us));
    let pixels = |event: &Event| (event.x, event.y, event.polarity);
    let seen = seen();
    let same = heard.iter().zip(&seen).take_while(|(a, b)| pixels(a) == pixels(b)).count();
    let rest = heard.iter().rev().zip(seen.iter().rev());
    let same_behind = rest.take_while(|(a, b)| pixels(a) == pixels(b)).count();
    assert!(same + same_behind >= heard.len(), "{same} + {same_behind} of {}", heard.len());
}

#[test]
fn unplugged_in_mid_stream_and_plugged_in_again() {
    let port = World::begin(vec![(0, plug(camera())), (MIDDLE, Act::Unplug), (1_500, Act::Replug)]);
    let heard = run(&port, ANY, 8_000, all_sent);
    assert_eq!(heard.stands, [NOBODY, THERE, NOBODY, THERE]);
    assert_eq!(heard.acquired.sessions, 2);
    // What was in the camera's FIFO is gone: a few milliseconds.
    let missing = COUNT as usize - heard.events.len();
    assert!(missing < 2_000, "{missing}");
    one_gap(&heard.events);
    let step_us = heard.events.windows(2).map(|pair| pair[1].t_us - pair[0].t_us).max();
    assert!(step_us >= Some(3_000_000), "no window spans it: {step_us:?}");
}

#[test]
fn gone_without_a_word_from_the_port() {
    let port = World::begin(vec![(0, plug(camera())), (MIDDLE, Act::Vanish), (4_500, Act::Replug)]);
    let heard = run(&port, ANY, 9_000, all_sent);
    let stands = &heard.stands;
    assert_eq!(stands[..3], [NOBODY, THERE, trouble(Trouble::Damaged)]);
    assert_eq!(stands.last(), Some(&THERE));
    assert!(port.0.borrow().resets > 0, "asked again without being told");
    one_gap(&heard.events);
}

#[test]
fn silent_and_unreachable_is_found_out_by_asking() {
    let port = World::begin(vec![(0, plug(camera())), (MIDDLE, Act::Hang)]);
    let heard = run(&port, ANY, 4_000, |now, _| now.trouble.is_some());
    assert_eq!(heard.stands, [NOBODY, THERE, trouble(Trouble::NoAnswer)]);
}

#[test]
fn a_port_that_loses_its_device_while_it_waits_says_so() {
    // Nothing to read, and nothing that fails: only the port knows.
    let idle = Camera::new(Model::Dvxplorer, vec![]);
    let port = World::begin(vec![(0, plug(idle)), (MIDDLE, Act::Hang), (MIDDLE + 20, Act::Unplug)]);
    let heard = run(&port, ANY, 4_000, |now, _| now.sessions == 1 && now.camera.is_none());
    assert_eq!(heard.stands, [NOBODY, (Some(Model::Dvxplorer), None), NOBODY]);
    assert!(heard.took < Duration::from_millis(MIDDLE + 400), "before it would have been asked");
}

#[test]
fn a_halted_endpoint_is_cleared_and_read_on() {
    let mut camera = camera();
    camera.plan(10_000, Fault::Halt);
    camera.plan(20_000, Fault::Halt);
    let port = World::begin(vec![(0, plug(camera))]);
    let heard = run(&port, ANY, 9_000, all_sent);
    assert!(heard.events == seen(), "{}", heard.acquired);
    assert_eq!((heard.acquired.stalls, heard.acquired.sessions), (2, 1));
}

#[test]
fn an_endpoint_that_halts_for_good_is_given_up_by_name() {
    let mut camera = camera();
    camera.plan(10_000, Fault::Dead);
    let port = World::begin(vec![(0, plug(camera))]);
    let heard = run(&port, ANY, 4_000, |now, _| now.trouble.is_some());
    assert_eq!(heard.stands, [NOBODY, THERE, trouble(Trouble::Stalled)]);
    assert_eq!(heard.acquired.stalls, 6);
}

#[test]
fn a_few_errors_on_the_wire_cost_nothing_and_many_are_told() {
    let port =
        World::begin(vec![(0, plug(camera())), (MIDDLE, Act::Fail(PipeError::BadResponse, 3))]);
    let heard = run(&port, ANY, 9_000, all_sent);
    assert_eq!((heard.acquired.errors, heard.acquired.sessions), (3, 1));
    assert_eq!(heard.acquired.seen(), COUNT);

    let port = World::begin(vec![(0, plug(camera())), (MIDDLE, Act::Fail(PipeError::Babble, 6))]);
    let heard = run(&port, ANY, 8_000, all_sent);
    assert_eq!(heard.stands, [NOBODY, THERE, trouble(Trouble::Damaged), THERE]);
    // It was left running meanwhile, and began anew.
    assert_eq!(heard.acquired.sessions, 2);
}

#[test]
fn half_a_word_is_left_out_and_the_rest_is_read_on() {
    let mut camera = camera();
    camera.plan(10_000, Fault::Odd);
    let port = World::begin(vec![(0, plug(camera))]);
    let heard = run(&port, ANY, 9_000, all_sent);
    assert_eq!(heard.acquired.damaged_words, 1);
    let missing = COUNT as usize - heard.events.len();
    assert!(missing < 10, "{missing}");
    assert!(heard.events.windows(2).all(|pair| pair[0].t_us <= pair[1].t_us));
}
