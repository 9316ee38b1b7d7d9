//! Every command, as the manual writes it.

use super::status::Mask;

/// What a command does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// IEEE 488.2.
    Common(Common),
    /// A value of the reading that stands: no waiting.
    Fetch(Item),
    /// The speed of the next reading.
    Read,
    /// Goes live, and the next speed.
    Measure,
    /// Goes live, and chooses the rotor.
    Configure,
    /// What `MEASure?` would measure.
    Configured,
    /// A preference or a setting of the measurement.
    Set(Setting),
    /// The same, asked for.
    Get(Setting),
    /// Whether a speed lies outside of its limits.
    LimitFail,
    /// No limits.
    LimitClear,
    /// What has been collected.
    Collected(Collected),
    /// Forgets what has been collected.
    CollectedClear,
    /// The device as a whole.
    System(System),
    /// A register.
    Status(Group, Access),
    /// Masks and filters as at power-on.
    StatusPreset,
    /// The recorder.
    Record(Record),
    /// The pixels on the screen.
    Hardcopy,
}

/// Commands of IEEE 488.2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Common {
    Cls,
    Ese,
    EseQuery,
    EsrQuery,
    IdnQuery,
    Opc,
    OpcQuery,
    Rst,
    Sre,
    SreQuery,
    StbQuery,
    TstQuery,
    Wai,
}

/// A part of a reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Item {
    /// Magnitude of the speed.
    Speed,
    /// Its standard error.
    Sigma,
    /// Sense of rotation.
    Direction,
    /// Blades.
    Blades,
    /// Centre and radius.
    Position,
    /// How far the measurement got.
    Status,
    /// Why there is no speed.
    Reason,
    /// Every rotor.
    All,
    /// Letters of the rotors.
    Rotors,
    /// Middle of the window.
    Time,
    /// Length of the window.
    Window,
    /// Events, and those not used.
    Events,
}

/// What can be set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Setting {
    /// Unit of speeds.
    Unit,
    /// Blades, where a person knows better.
    Blades,
    /// What the sensor's clock runs fast by.
    Clock,
    /// Part of the sensor to look at.
    Roi,
    /// Length of the window.
    Window,
    /// A limit.
    Limit(Side),
    /// Whether it is watched.
    LimitState(Side),
}

/// Which limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// The slowest speed that is well.
    Lower,
    /// The fastest.
    Upper,
}

/// What is collected over readings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Collected {
    /// The fastest.
    Maximum,
    /// The slowest.
    Minimum,
    /// The mean.
    Average,
    /// Readings within.
    Count,
    /// Revolutions.
    Revolutions,
}

/// `SYSTem`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum System {
    Error,
    ErrorCount,
    Version,
    Log,
    LogQuery,
    Fault,
    FaultClear,
    Sensor,
    Events,
    Preset,
    Headers,
}

/// A status register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// What the device does.
    Operation,
    /// What is wrong with its readings.
    Questionable,
}

/// How it is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Events, which clears them.
    Event,
    /// What is so now.
    Condition,
    /// Writes a mask.
    Write(Mask),
    /// Reads a mask.
    Read(Mask),
}

/// `DATA:RECord`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Record {
    Start,
    Stop,
    State,
    Events,
    Capacity,
    Data,
}

/// The registers' commands, which are the same for both.
macro_rules! table {
    ($($line:expr,)+; $($name:literal => $group:expr),+) => {
        &[
            $($line,)+
            $(
                (concat!("STATus:", $name, "[:EVENt]?"), Command::Status($group, Access::Event)),
                (concat!("STATus:", $name, ":CONDition?"), Command::Status($group, Access::Condition)),
                (concat!("STATus:", $name, ":ENABle"), Command::Status($group, Access::Write(Mask::Enable))),
                (concat!("STATus:", $name, ":ENABle?"), Command::Status($group, Access::Read(Mask::Enable))),
                (concat!("STATus:", $name, ":PTRansition"), Command::Status($group, Access::Write(Mask::Positive))),
                (concat!("STATus:", $name, ":PTRansition?"), Command::Status($group, Access::Read(Mask::Positive))),
                (concat!("STATus:", $name, ":NTRansition"), Command::Status($group, Access::Write(Mask::Negative))),
                (concat!("STATus:", $name, ":NTRansition?"), Command::Status($group, Access::Read(Mask::Negative))),
            )+
        ]
    };
}

/// Every header: capitals are the short form, brackets may be left out.
pub const COMMANDS: &[(&str, Command)] = table![
    ("*CLS", Command::Common(Common::Cls)),
    ("*ESE", Command::Common(Common::Ese)),
    ("*ESE?", Command::Common(Common::EseQuery)),
    ("*ESR?", Command::Common(Common::EsrQuery)),
    ("*IDN?", Command::Common(Common::IdnQuery)),
    ("*OPC", Command::Common(Common::Opc)),
    ("*OPC?", Command::Common(Common::OpcQuery)),
    ("*RST", Command::Common(Common::Rst)),
    ("*SRE", Command::Common(Common::Sre)),
    ("*SRE?", Command::Common(Common::SreQuery)),
    ("*STB?", Command::Common(Common::StbQuery)),
    ("*TST?", Command::Common(Common::TstQuery)),
    ("*WAI", Command::Common(Common::Wai)),
    ("MEASure[:SPEed]?", Command::Measure),
    ("READ[:SPEed]?", Command::Read),
    ("FETCh[:SPEed]?", Command::Fetch(Item::Speed)),
    ("FETCh:SIGMa?", Command::Fetch(Item::Sigma)),
    ("FETCh:DIRection?", Command::Fetch(Item::Direction)),
    ("FETCh:BLADes?", Command::Fetch(Item::Blades)),
    ("FETCh:POSition?", Command::Fetch(Item::Position)),
    ("FETCh:STATus?", Command::Fetch(Item::Status)),
    ("FETCh:REASon?", Command::Fetch(Item::Reason)),
    ("FETCh:ALL?", Command::Fetch(Item::All)),
    ("FETCh:ROTors?", Command::Fetch(Item::Rotors)),
    ("FETCh:TIME?", Command::Fetch(Item::Time)),
    ("FETCh:WINDow?", Command::Fetch(Item::Window)),
    ("FETCh:EVENts?", Command::Fetch(Item::Events)),
    ("CONFigure[:SPEed]", Command::Configure),
    ("CONFigure?", Command::Configured),
    ("UNIT[:SPEed]", Command::Set(Setting::Unit)),
    ("UNIT[:SPEed]?", Command::Get(Setting::Unit)),
    ("[SENSe:]BLADes", Command::Set(Setting::Blades)),
    ("[SENSe:]BLADes?", Command::Get(Setting::Blades)),
    ("[SENSe:]ROI", Command::Set(Setting::Roi)),
    ("[SENSe:]ROI?", Command::Get(Setting::Roi)),
    ("[SENSe:]WINDow", Command::Set(Setting::Window)),
    ("[SENSe:]WINDow?", Command::Get(Setting::Window)),
    ("[SENSe:]CORRection:CLOCk", Command::Set(Setting::Clock)),
    ("[SENSe:]CORRection:CLOCk?", Command::Get(Setting::Clock)),
    ("CALCulate:LIMit:LOWer[:DATA]", Command::Set(Setting::Limit(Side::Lower))),
    ("CALCulate:LIMit:LOWer[:DATA]?", Command::Get(Setting::Limit(Side::Lower))),
    ("CALCulate:LIMit:LOWer:STATe", Command::Set(Setting::LimitState(Side::Lower))),
    ("CALCulate:LIMit:LOWer:STATe?", Command::Get(Setting::LimitState(Side::Lower))),
    ("CALCulate:LIMit:UPPer[:DATA]", Command::Set(Setting::Limit(Side::Upper))),
    ("CALCulate:LIMit:UPPer[:DATA]?", Command::Get(Setting::Limit(Side::Upper))),
    ("CALCulate:LIMit:UPPer:STATe", Command::Set(Setting::LimitState(Side::Upper))),
    ("CALCulate:LIMit:UPPer:STATe?", Command::Get(Setting::LimitState(Side::Upper))),
    ("CALCulate:LIMit:FAIL?", Command::LimitFail),
    ("CALCulate:LIMit:CLEar", Command::LimitClear),
    ("CALCulate:AVERage:MAXimum?", Command::Collected(Collected::Maximum)),
    ("CALCulate:AVERage:MINimum?", Command::Collected(Collected::Minimum)),
    ("CALCulate:AVERage:AVERage?", Command::Collected(Collected::Average)),
    ("CALCulate:AVERage:COUNt?", Command::Collected(Collected::Count)),
    ("CALCulate:AVERage:REVolutions?", Command::Collected(Collected::Revolutions)),
    ("CALCulate:AVERage:CLEar", Command::CollectedClear),
    ("SYSTem:ERRor[:NEXT]?", Command::System(System::Error)),
    ("SYSTem:ERRor:COUNt?", Command::System(System::ErrorCount)),
    ("SYSTem:VERSion?", Command::System(System::Version)),
    ("SYSTem:LOG", Command::System(System::Log)),
    ("SYSTem:LOG?", Command::System(System::LogQuery)),
    ("SYSTem:FAULt?", Command::System(System::Fault)),
    ("SYSTem:FAULt:CLEar", Command::System(System::FaultClear)),
    ("SYSTem:SENSor?", Command::System(System::Sensor)),
    ("SYSTem:EVENts?", Command::System(System::Events)),
    ("SYSTem:PRESet", Command::System(System::Preset)),
    ("SYSTem:HELP:HEADers?", Command::System(System::Headers)),
    ("HCOPy:SDUMp:DATA?", Command::Hardcopy),
    ("STATus:PRESet", Command::StatusPreset),
    ("DATA:RECord:STARt", Command::Record(Record::Start)),
    ("DATA:RECord:STOP", Command::Record(Record::Stop)),
    ("DATA:RECord:STATe?", Command::Record(Record::State)),
    ("DATA:RECord:EVENts?", Command::Record(Record::Events)),
    ("DATA:RECord:CAPacity?", Command::Record(Record::Capacity)),
    ("DATA:RECord[:DATA]?", Command::Record(Record::Data)),
    ;
    "OPERation" => Group::Operation,
    "QUEStionable" => Group::Questionable
];

/// Bytes of the list of all headers, a line each.
pub const HEADERS_BYTES: u32 = {
    let mut bytes = 0;
    let mut index = 0;
    while index < COMMANDS.len() {
        bytes += COMMANDS[index].0.len() + 1;
        index += 1;
    }
    bytes as u32
};

/// Copies the list of all headers from a byte on; bytes beyond its end are not touched.
pub fn copy_headers(offset: u32, out: &mut [u8]) {
    let lines = COMMANDS.iter().flat_map(|(pattern, _)| pattern.bytes().chain([b'\n']));
    out.iter_mut().zip(lines.skip(offset as usize)).for_each(|(out, byte)| *out = byte);
}
