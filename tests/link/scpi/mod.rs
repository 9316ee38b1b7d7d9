//! SCPI as a person types it: what is answered, what is refused, and that nothing hangs.

mod log;
mod recording;

use evtach_core::{Evidence, Frame, Reading, Reason, RotorReading, Speed, Status};
use evtach_firmware::instrument::{Fault, Sensor, Unit};
use evtach_firmware::scpi::{ErrorCode, LINE_BYTES, Link, READING_TIMEOUT_US, Statistics};
use evtach_firmware::sensor::usb::Trouble;
use proptest::prelude::*;
use recording::block;

use crate::bench::{Bench, drain, exchange};

fn rotor(id: u8, rpm: f32) -> RotorReading {
    RotorReading {
        id,
        x_px: 165.25,
        y_px: 150.0,
        radius_px: 52.123_456,
        blades: Some(5),
        status: Status::Locked,
        speed: Some(Speed {
            omega_rad_s: rpm / Speed::RPM_PER_RAD_S,
            omega_sigma_rad_s: 0.0125,
            alpha_rad_s2: None,
            frame: Frame::Camera,
        }),
        evidence: Evidence::default(),
    }
}

fn refused(id: u8, reason: Reason) -> RotorReading {
    RotorReading { status: Status::Refused(reason), speed: None, blades: None, ..rotor(id, 0.0) }
}

fn reading(rotors: &[RotorReading]) -> Reading {
    Reading {
        t_us: 1_234_567,
        window_us: 150_000,
        events: 1000,
        thinned: 20,
        lost: 3,
        status: Status::Locked,
        rotors: rotors.iter().cloned().collect(),
    }
}

/// A device that shows two rotors, A at 3000 rpm clockwise and C refused, and a link to it.
struct Session {
    link: Link,
    bench: Bench,
}

impl Session {
    fn new() -> Self {
        let mut bench = Bench::new(8 * 100);
        bench.show(reading(&[rotor(0, 3000.0), refused(2, Reason::Ambiguous)]));
        Self { link: Link::new(), bench }
    }

    fn ask(&mut self, line: &str) -> String {
        self.send(format!("{line}\n").as_bytes())
    }

    fn send(&mut self, bytes: &[u8]) -> String {
        let out = exchange(&mut self.link, &mut self.bench, bytes, 0);
        String::from_utf8(out).expect("text")
    }

    /// The number of the oldest error.
    fn error(&mut self) -> i32 {
        let answer = self.ask("SYST:ERR?");
        answer.split(',').next().and_then(|number| number.parse().ok()).expect("a number")
    }
}

#[test]
fn a_session_as_a_person_types_it() {
    let mut session = Session::new();
    for (line, answer) in [
        ("*IDN?", "EV-Tach,EV-Tach,0,1.2.3\n"),
        ("*idn?;*opc?", "EV-Tach,EV-Tach,0,1.2.3;1\n"),
        ("FETC?", "3000.0\n"),
        ("FETCH:SPEED? A", "3000.0\n"),
        ("fetc? 1", "3000.0\n"),
        ("FETC? C;:FETC:REAS? C", "9.91E+37;\"ambiguous\"\n"),
        ("FETC? b;REAS? b", "9.91E+37\n"),
        ("FETC:REAS? B;STAT?;DIR?;BLAD?", "\"no_rotation\";\"locked\";CW;5\n"),
        ("FETC:TIME?;WIND?;EVEN?", "1.234567;0.150000;1000,20,3\n"),
        ("FETC:ROT?", "2,A,C\n"),
        ("FETC:POS?", "165.25,150.0,52.123455\n"),
        ("UNIT HZ;UNIT?;:FETC?", "HZ;50.0\n"),
        ("UNIT:SPE MS;:FETC?", "20.0\n"),
        (
            "FETC:ALL?",
            "2,A,20.0,0.00079577486,CW,5,\"locked\",C,9.91E+37,9.91E+37,NONE,9.91E+37,\"refused\"\n",
        ),
        ("SENS:BLAD 3;:BLAD?", "3\n"),
        ("BLADES AUTO;BLADES?", "AUTO\n"),
        ("SENS:CORR:CLOC -12.5 PPM;CLOC?", "-12.5\n"),
        ("SENS:ROI 10,20,100,50;ROI?;ROI FULL;ROI?", "10,20,100,50;FULL\n"),
        ("SENS:WIND 150 MS;WIND?;WIND AUTO;WIND?", "0.150000;AUTO\n"),
        ("UNIT RPM;:CALC:LIM:UPP 1.5E3 RPM;LOW 20 HZ;UPP?;LOW?", "1500.0;1200.0\n"),
        ("CALC:LIM:UPP:STAT?;STAT OFF;STAT?;:CALC:LIM:UPP?", "1;0;9.91E+37\n"),
        ("CALC:LIM:FAIL?", "0\n"),
        ("SYST:VERS?", "1999.0\n"),
        ("SYST:LOG?", "0\n"),
        ("STAT:OPER:COND?", "528\n"),
        ("STAT:OPER?;OPER?", "528;0\n"),
        ("STAT:QUES:ENAB #H7FFF;ENAB?;PTR?;NTR?", "32767;32767;0\n"),
        ("CONF C;CONF?;CONF;CONF?", "\"SPEED\",C;\"SPEED\",AUTO\n"),
        ("*ESE 60;*ESE?;*SRE 255;*SRE?", "60;191\n"),
        ("*WAI;*OPC;*TST?", "0\n"),
        ("", ""),
        (" \r", ""),
        (
            "SYST:ERR?",
            "-113,\"Undefined header;byte 9: SYSTem:HELP:HEADers? lists the commands\"\n",
        ),
        ("SYST:ERR:COUN?;NEXT?", "0;0,\"No error\"\n"),
    ] {
        assert_eq!(session.ask(line), answer, "{line}");
    }
    assert_eq!(session.bench.preferences.unit, Unit::Rpm);
    assert_eq!(session.bench.preferences.alarm.low_rpm, Some(1200.0));
}

#[test]
fn what_is_wrong_is_told_by_number_and_place() {
    let mut session = Session::new();
    assert_eq!(session.ask("*ESR?"), "128\n", "power on");
    for (line, number, event) in [
        ("FOO?", -113, 32),
        ("FETC", -113, 32),
        ("*RST?", -113, 32),
        ("CALC:LIM2:FAIL?", -114, 32),
        ("UNIT", -109, 32),
        ("UNIT RPM,HZ", -108, 32),
        ("*CLS 1", -108, 32),
        ("UNIT FURLONG", -141, 32),
        ("UNIT 3", -104, 32),
        ("BLAD 3 RPM", -131, 32),
        ("BLAD #15hello", -168, 32),
        ("UNIT 'RPM", -151, 32),
        ("UNIT!", -102, 32),
        ("BLAD 1x!", -131, 32),
        ("BLAD 33", -222, 16),
        ("BLAD 0", -222, 16),
        ("BLAD 1E99", -222, 16),
        ("FETC? 0", -222, 16),
        ("CORR:CLOC 1001", -222, 16),
        ("CALC:LIM:UPP 0", -222, 16),
        ("CALC:LIM:UPP:STAT ON", -221, 16),
        ("ROI 300,0,30,10", -222, 16),
        ("WIND 3", -222, 16),
        ("DATA:REC?", -230, 16),
        ("DATA:REC:STAR 101", -222, 16),
        ("*ESE 256", -222, 16),
    ] {
        assert_eq!(session.ask(line), "", "{line}");
        assert_eq!(session.error(), number, "{line}");
        assert_eq!(session.error(), 0, "{line}: one error");
        assert_eq!(session.ask("*ESR?"), format!("{event}\n"), "{line}");
    }
    assert_eq!(session.ask("UNIT\u{7f}"), "");
    assert_eq!(session.error(), -101);
    assert_eq!(session.ask("BLAD 2;BLAD 99"), "");
    let told = "-222,\"Data out of range;byte 13: see the command's range in scpi.md\"\n";
    assert_eq!(session.ask("SYST:ERR?"), told);
}

#[test]
fn a_command_error_ends_its_line_and_an_execution_error_does_not() {
    let mut session = Session::new();
    assert_eq!(session.ask("*OPC?;FOO?;*OPC?"), "1\n");
    assert_eq!(session.ask("*OPC?;BLAD 99;*OPC?"), "1;1\n");
    assert_eq!((session.error(), session.error(), session.error()), (-113, -222, 0));
}

#[test]
fn the_queue_of_errors_overflows_as_the_standard_says() {
    let mut session = Session::new();
    for _ in 0..20 {
        session.ask("FOO");
    }
    assert_eq!(session.ask("SYST:ERR:COUN?"), "16\n");
    let numbers: Vec<i32> = (0..17).map(|_| session.error()).collect();
    assert_eq!(numbers[..15], [-113; 15]);
    assert_eq!(numbers[15..], [-350, 0]);
    session.ask("FOO");
    assert_eq!(session.ask("*CLS;SYST:ERR?"), "0,\"No error\"\n");
}

#[test]
fn service_is_asked_for_by_the_status_byte() {
    let mut session = Session::new();
    assert_eq!(session.ask("*CLS;*STB?"), "0\n");
    assert_eq!(session.ask("*ESE 32;*SRE 36;FOO"), "");
    assert_eq!(session.ask("*STB?"), format!("{}\n", 4 + 32 + 64));
    assert_eq!(session.ask("*ESR?;*STB?"), format!("32;{}\n", 4 + 64));
    session.bench.reading = None;
    session.bench.sensor = Sensor::Absent;
    session.bench.alarm = true;
    assert_eq!(session.ask("STAT:QUES:COND?"), format!("{}\n", 32 + 1024 + 2048));
    assert_eq!(session.ask("STAT:QUES:ENAB 1024;*CLS;*STB?"), "0\n", "the event is old");
    session.bench.sensor = Sensor::Present;
    session.ask("");
    session.bench.sensor = Sensor::Absent;
    assert_eq!(session.ask("*CLS"), "", "clears what came with the line");
}

#[test]
fn overlong_lines_are_one_error_and_the_next_is_heard() {
    let mut session = Session::new();
    let long = "A".repeat(100_000);
    assert_eq!(session.ask(&long), "");
    assert_eq!((session.error(), session.error()), (-363, 0));
    // The longest line that fits.
    let line = format!("{:>LINE_BYTES$}", "*OPC?");
    assert_eq!(session.ask(&line), "1\n");
    assert_eq!(session.ask(&format!("{line}\r")), "1\n", "a carriage return is none of it");
    assert_eq!(session.ask(&format!("  {line}")), "");
    assert_eq!(session.error(), -363);
}

#[test]
fn a_reading_is_waited_for_and_not_longer_than_a_client_waits() {
    let mut session = Session::new();
    let Session { link, bench } = &mut session;
    assert_eq!(exchange(link, bench, b"READ?;*OPC?\n", 10), b"");
    // Meanwhile, the next line waits.
    assert_eq!(link.receive(b"*IDN?\n"), 0);
    assert_eq!(drain(link, bench, READING_TIMEOUT_US), b"");
    bench.show(reading(&[refused(0, Reason::Searching)]));
    assert_eq!(drain(link, bench, READING_TIMEOUT_US), b"9.91E+37;1\n", "READ? takes any");

    assert_eq!(exchange(link, bench, b"*OPC?;MEAS?\n", 10), b"1");
    bench.show(reading(&[refused(0, Reason::Searching)]));
    assert_eq!(drain(link, bench, 20), b"", "MEASure? waits for a speed");
    bench.show(reading(&[rotor(0, 1500.0)]));
    assert_eq!(drain(link, bench, 30), b";1500.0\n");

    // What stood before is no next reading.
    assert_eq!(exchange(link, bench, b"MEAS?\n", 40), b"");
    assert_eq!(drain(link, bench, 40 + READING_TIMEOUT_US), b"9.91E+37\n");
    assert_eq!(exchange(link, bench, b"FETC?\n", 50), b"1500.0\n");

    assert_eq!(exchange(link, bench, b"MEAS? B\n", 0), b"");
    bench.show(reading(&[rotor(0, 1500.0)]));
    assert_eq!(drain(link, bench, READING_TIMEOUT_US - 1), b"");
    assert_eq!(drain(link, bench, READING_TIMEOUT_US), b"9.91E+37\n");
}

#[test]
fn control_c_ends_whatever_is_under_way() {
    let mut session = Session::new();
    assert_eq!(session.ask("READ?"), "");
    assert_eq!(session.send(b"\x03*OPC?\n"), "1\n");
    assert_eq!(session.send(b"UNIT \x03*OPC?\n"), "1\n");
    session.bench.start(10);
    let Session { link, bench } = &mut session;
    link.receive(b"DATA:REC?\n");
    link.run(0, bench);
    assert!(link.transmit(&mut [0; 10], bench) > 0);
    link.receive(b"\x03");
    assert!(link.is_idle());
    // As when nobody fetches it.
    link.receive(b"DATA:REC?\n");
    link.run(0, bench);
    assert!(link.transmit(&mut [0; 10], bench) > 0);
    link.forget();
    assert!(link.is_idle());
    assert_eq!(session.ask("*OPC?"), "1\n");
}

#[test]
fn a_rotor_that_was_chosen_and_is_gone_has_a_reason() {
    let mut session = Session::new();
    session.bench.show(reading(&[rotor(0, 1500.0)]));
    assert_eq!(session.ask("FETC:REAS?"), "\"\"\n");
    session.bench.selected = Some(1);
    assert_eq!(session.ask("FETC?;:FETC:REAS?"), "9.91E+37;\"no_rotation\"\n");
}

#[test]
fn headers_are_listed_and_in_the_manual() {
    let mut session = Session::new();
    let answer = session.ask("SYST:HELP:HEAD?");
    let (list, rest) = block(answer.as_bytes());
    assert_eq!(rest, b"\n");
    let list = std::str::from_utf8(list).expect("text");
    let manual = concat!(env!("CARGO_MANIFEST_DIR"), "/../firmware/docs/scpi.md");
    let manual = std::fs::read_to_string(manual).expect("the manual");
    assert!(list.lines().count() > 60);
    for header in list.lines() {
        assert!(manual.contains(&format!("`{header}")), "{header} is not in scpi.md");
    }
    for code in ErrorCode::ALL {
        let row = format!("| {} | {} |", code.number(), code.text());
        assert!(manual.contains(&row), "{row} is not in scpi.md");
    }
}

#[test]
fn faults_and_lost_preferences_are_told() {
    let mut session = Session::new();
    session.bench.fault = Some((Fault::Panic, "store.rs:12: \"no\"\nroom".to_owned()));
    assert_eq!(session.ask("*TST?;SYST:FAUL?"), "2;\"panic\",\"store.rs:12: \"\"no\"\"?room\"\n");
    assert_eq!((session.error(), session.error()), (-310, 0));
    assert_eq!(session.ask("SYST:FAUL:CLE;:SYST:FAUL?"), "\"none\",\"\"\n");
    session.bench.fault = Some((Fault::Preferences, String::new()));
    assert_eq!(session.error(), -314);
}

#[test]
fn why_there_is_no_sensor_is_told() {
    let mut session = Session::new();
    assert_eq!(session.ask("SYST:SENS?"), "\"present\",\"\"\n");
    session.bench.sensor = Sensor::Absent;
    assert_eq!(session.ask("SYST:SENS?"), "\"absent\",\"\"\n");
    session.bench.trouble = Some(Trouble::Foreign { vendor_id: 0x046d, product_id: 0xc52b });
    let words = "046d:c52b is no camera known here: plug in another";
    assert_eq!(session.ask("SYST:EVEN?"), "800,150,30,15,5\n");
    assert_eq!(session.ask("SYST:SENS?"), format!("\"refused\",\"{words}\"\n"));
}

#[test]
fn reset_keeps_the_calibration() {
    let mut session = Session::new();
    session.ask("UNIT HZ;CORR:CLOC 7;:BLAD 3;:CALC:LIM:UPP 100;:CONF C;:SYST:LOG ON;*RST");
    assert_eq!(session.ask("UNIT?;CORR:CLOC?;:BLAD?;:CONF?"), "RPM;7.0;AUTO;\"SPEED\",AUTO\n");
    assert_eq!(session.ask("CALC:LIM:UPP:STAT?;:SYST:LOG?"), "0;0\n");
    let saves = session.bench.saves;
    session.ask("*RST;UNIT RPM;:CALC:LIM:CLE;:BLAD AUTO;:CORR:CLOC 7");
    assert_eq!(session.bench.saves, saves, "what does not change wears no flash");
}

#[test]
fn statistics_are_collected_elsewhere_and_told_here() {
    let mut session = Session::new();
    assert_eq!(session.ask("CALC:AVER:MAX?;COUN?"), "9.91E+37;0\n");
    session.bench.statistics =
        Some(Statistics { max_rpm: 6600.0, min_rpm: 5400.0, mean_rpm: 6000.0, readings: 7 });
    let answer = session.ask("UNIT HZ;:CALC:AVER:MAX?;MIN?;AVER?;COUN?;REV?;CLE;COUN?");
    assert_eq!(answer, "110.0;90.0;100.0;7;12.5;0\n");
}

proptest! {
    #[test]
    fn any_bytes_leave_a_link_that_answers(
        bytes in prop::collection::vec(
            prop_oneof![any::<u8>(), prop::sample::select(b"*:;?, \n\"'#ABFETCHMEASUREDATAREC0123".to_vec())],
            0..2000,
        ),
    ) {
        let mut session = Session::new();
        exchange(&mut session.link, &mut session.bench, &bytes, 0);
        prop_assert_eq!(session.send(b"\x03*OPC?\n"), "1\n");
    }
}
