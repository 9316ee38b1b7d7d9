//! Stock PyVISA in front of the link: over a pseudo-terminal, as a serial port, and over TCP.
//!
//! The device is the firmware's own link, recorder and core, on the PC; its light is made up.

use std::fs::File;
use std::io::{ErrorKind, Read, Write};
use std::net::TcpListener;
use std::process::Child;
use std::time::{Duration, Instant};

use evtach_core::{Event, Geometry, Reading, Settings};
use evtach_firmware::instrument::Sensor;
use evtach_firmware::scpi::Link;
use evtach_host::measure::{Capacity, measure_events};
use evtach_host::synth::{self, Rotor, Scene};
use evtach_tests::visa::{check, out, python, session};
use rustix::fs::{OFlags, fcntl_setfl};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

use crate::bench::Bench;

/// Longest session that is not taken for a hang.
const PATIENCE: Duration = Duration::from_secs(60);

/// A device in front of a propeller at 1500 rpm, which it sees in real time, again and again.
struct Player {
    bench: Bench,
    events: Vec<Event>,
    readings: Vec<Reading>,
    /// When the light began.
    since: Instant,
    /// Events and readings that have been.
    played: (usize, usize),
    recording: bool,
}

impl Player {
    fn new() -> Self {
        let rotor = Rotor { blades: 5, rpm: -1500.0, ..Rotor::default() };
        let scene = Scene { duration_ms: 800.0, rotors: vec![rotor], ..Scene::default() };
        let geometry = Geometry::new(scene.width_px, scene.height_px).expect("a sensor in range");
        let events = synth::generate(&scene).expect("a scene in range").events;
        let (readings, _) = measure_events(&events, &[], Settings::new(geometry), Capacity::Device);
        let mut bench = Bench::new(8 * 200_000);
        bench.geometry = Some(geometry);
        bench.sensor = Sensor::Present;
        bench.first_us = events.first().map_or(0, |event| event.t_us);
        Self { bench, events, readings, since: Instant::now(), played: (0, 0), recording: false }
    }

    fn play(&mut self) {
        let recording = self.bench.recorder.as_ref().is_some_and(|recorder| recorder.is_running());
        // A recording begins with the light, so that it holds no seam.
        if self.played.0 == self.events.len() || recording && !self.recording {
            self.since = Instant::now();
            self.played = (0, 0);
        }
        self.recording = recording;
        let now_us = self.bench.first_us + self.since.elapsed().as_micros() as u64;
        let events = &self.events[self.played.0..];
        let events = &events[..events.partition_point(|event| event.t_us <= now_us)];
        self.played.0 += events.len();
        self.bench.record(events);
        while let Some(reading) = self.readings.get(self.played.1)
            && reading.t_us + u64::from(reading.window_us / 2) <= now_us
        {
            self.played.1 += 1;
            let reading = reading.clone();
            self.bench.alarm = reading.rotors.iter().any(|rotor| {
                let limit = self.bench.preferences.alarm.high_rpm.unwrap_or(f32::INFINITY);
                rotor.speed.is_some_and(|speed| speed.rpm() > limit)
            });
            self.bench.show(reading);
        }
    }

    /// Answers on a port until the client has gone.
    fn serve(&mut self, port: &mut (impl Read + Write), client: &mut Child) {
        let start = Instant::now();
        let mut link = Link::new();
        let (mut received, mut sending) = (Vec::new(), Vec::new());
        while client.try_wait().expect("a child").is_none() {
            assert!(start.elapsed() < PATIENCE, "the session hangs");
            self.play();
            let mut bytes = [0; 64];
            let count = unless_late(port.read(&mut bytes));
            if count == 0 && sending.is_empty() {
                std::thread::sleep(Duration::from_millis(1));
            }
            received.extend_from_slice(&bytes[..count]);
            let taken = link.receive(&received);
            received.drain(..taken);
            loop {
                link.run(start.elapsed().as_micros() as u64, &mut self.bench);
                if sending.is_empty() {
                    let mut piece = [0; 512];
                    let count = link.transmit(&mut piece, &mut self.bench);
                    sending.extend_from_slice(&piece[..count]);
                }
                if sending.is_empty() {
                    break;
                }
                let sent = unless_late(port.write(&sending));
                sending.drain(..sent);
                if sent == 0 {
                    break;
                }
            }
        }
    }
}

/// Bytes moved; none while the other end is not ready.
fn unless_late(result: std::io::Result<usize>) -> usize {
    result.unwrap_or_else(|error| {
        assert_eq!(error.kind(), ErrorKind::WouldBlock, "{error}");
        0
    })
}

/// The device's end, which does not wait; the name of the other; and the other held open, without which the first reads
/// as broken.
fn pseudo_terminal() -> (File, String, File) {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).expect("a pseudo-terminal");
    grantpt(&master).expect("its other end");
    unlockpt(&master).expect("its other end");
    let name = ptsname(&master, Vec::new()).expect("its name").into_string().expect("text");
    let slave = File::options().read(true).write(true).open(&name).expect("its other end");
    let mut termios = tcgetattr(&slave).expect("a terminal");
    termios.make_raw();
    tcsetattr(&slave, OptionalActions::Now, &termios).expect("a terminal");
    fcntl_setfl(&master, OFlags::NONBLOCK).expect("a terminal");
    (master.into(), name, slave)
}

#[test]
fn over_a_serial_port_and_over_tcp() {
    let Some(python) = python() else { return };
    let mut player = Player::new();

    let (mut master, name, _slave) = pseudo_terminal();
    let file = out("serial");
    let mut client = session(&python, &name, &file);
    player.serve(&mut master, &mut client);
    check(client, &file, "1.2.3");
    std::fs::remove_file(&file).expect("the recording");

    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let port = listener.local_addr().expect("an address").port();
    let file = out("tcp");
    let mut client = session(&python, &format!("TCPIP::127.0.0.1::{port}::SOCKET"), &file);
    let (mut stream, _) = listener.accept().expect("the client connects");
    stream.set_nonblocking(true).expect("a socket");
    player.serve(&mut stream, &mut client);
    check(client, &file, "1.2.3");
    std::fs::remove_file(&file).expect("the recording");
}
