//! The size of the sensor: parsed, known by name, or inferred from where events lie.

use evtach_core::Geometry;

/// Parses "640x480" (also with blanks, `,` or `*` in between).
pub fn parse(text: &str) -> Option<Geometry> {
    let (width, height) = text.split_once(['x', 'X', ',', '*', ' '])?;
    let height = height.trim_start_matches(['x', 'X', ',', '*', ' ']);
    Geometry::new(width.trim().parse().ok()?, height.trim().parse().ok()?)
}

/// Size of a Prophesee or Sony sensor from any name that contains its model.
pub fn of_sensor(name: &str) -> Option<Geometry> {
    let name = name.to_ascii_lowercase();
    // Longer names first: "gen31" contains "gen3", "genx320" contains "gen".
    let (width_px, height_px) = [
        ("genx320", (320, 320)),
        ("saphir", (320, 320)),
        ("imx636", (1280, 720)),
        ("imx646", (1280, 720)),
        ("imx637", (640, 512)),
        ("imx647", (640, 512)),
        ("gen4", (1280, 720)),
        ("gen3", (640, 480)),
        ("gen2", (640, 480)),
        ("gen1", (304, 240)),
    ]
    .into_iter()
    .find_map(|(model, size)| name.contains(model).then_some(size))?;
    Geometry::new(width_px, height_px)
}

/// Size of the sensor behind a Prophesee `system_ID` (numbers as in OpenEB's `SystemId`).
pub fn of_system_id(id: u32) -> Option<Geometry> {
    match id {
        0x14 | 0x15 | 0x1c | 0x1d | 0x21..=0x23 | 0x28 | 0x29 => Geometry::new(640, 480),
        0x1e..=0x20 | 0x27 | 0x2e | 0x30..=0x32 | 0x35 | 0x3a | 0x42 => Geometry::new(1280, 720),
        0x37 | 0x3b | 0x40 => Geometry::new(320, 320),
        _ => None,
    }
}

/// The smallest known sensor that holds the columns and rows in which events lie; else just their extent.
pub fn of_extent(columns: u16, rows: u16) -> Option<Geometry> {
    const KNOWN: [(u16, u16); 12] = [
        (128, 128),
        (240, 180),
        (304, 240),
        (320, 240),
        (320, 320),
        (346, 260),
        (640, 480),
        (640, 512),
        (768, 640),
        (1280, 720),
        (1280, 800),
        (1280, 960),
    ];
    let extent = Geometry::new(columns, rows)?;
    KNOWN
        .into_iter()
        .find(|&(width, height)| columns <= width && rows <= height)
        .and_then(|(width, height)| Geometry::new(width, height))
        .or(Some(extent))
}

/// The size of a recording's sensor, and how it is known.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct KnownSize {
    pub size: Geometry,
    /// "from the header"
    pub how: String,
}

impl KnownSize {
    pub fn new(size: Geometry, how: impl Into<String>) -> Self {
        Self { size, how: how.into() }
    }

    /// A sentence for people: "640x480 from the header".
    pub fn sentence(&self) -> String {
        format!("{}x{} {}", self.size.width_px, self.size.height_px, self.how)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_parsed_in_the_spellings_in_use() {
        for text in ["640x480", "640X480", "640,480", "640 480", " 640 x 480 ".trim(), "640*480"] {
            assert_eq!(parse(text), Geometry::new(640, 480), "{text}");
        }
        for text in ["", "640", "0x480", "640x", "-1x480", "4096x480", "x480", "ax480"] {
            assert_eq!(parse(text), None, "{text}");
        }
    }

    #[test]
    fn models_do_not_shadow_each_other() {
        assert_eq!(of_sensor("hal_plugin_gen31_fx3"), Geometry::new(640, 480));
        assert_eq!(of_sensor("hal_plugin_gen41_evk3"), Geometry::new(1280, 720));
        assert_eq!(of_sensor("GenX320"), Geometry::new(320, 320));
        assert_eq!(of_sensor("none"), None);
    }

    #[test]
    fn extents_snap_to_the_next_known_sensor() {
        assert_eq!(of_extent(300, 250), Geometry::new(320, 320));
        assert_eq!(of_extent(346, 260), Geometry::new(346, 260));
        assert_eq!(of_extent(2000, 300), Geometry::new(2000, 300));
        assert_eq!(of_extent(0, 0), None);
    }
}
