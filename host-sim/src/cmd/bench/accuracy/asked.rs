//! What is asked of the means over the speeds.

use evtach_host::synth::Model;

use super::super::drive::Capacity;
use super::super::spec::{Mount, SEEDS, SPEEDS_RPM, model_name};
use super::cells::{Cells, Key, Place, Stage, Window};
use super::tables::FAST_RPM;

/// What is asked of one mean.
struct Asked {
    mount: Mount,
    blades: u8,
    stage: Stage,
    window: Window,
    gyro: bool,
    /// Slowest speed of the mean.
    from_rpm: u32,
    /// RMAE in permille at most.
    permille: f64,
}

impl Asked {
    /// Of a stage of the paper.
    const fn paper(mount: Mount, blades: u8, stage: Stage, permille: f64) -> Self {
        let window = Window::Paper;
        Self { mount, blades, stage, window, gyro: false, from_rpm: 0, permille }
    }

    /// Of the reading, with a window that adapts.
    const fn reading(mount: Mount, blades: u8, permille: f64) -> Self {
        Self { window: Window::Adaptive, ..Self::paper(mount, blades, Stage::Reading, permille) }
    }

    /// Of the same relative to the room.
    const fn room(gyro: bool, permille: f64) -> Self {
        Self { stage: Stage::Room, gyro, ..Self::reading(Mount::Handheld, 3, permille) }
    }

    /// How many times as much is allowed with this memory; `None`: nothing is asked.
    fn factor(&self, capacity: Capacity) -> Option<f64> {
        let of_the_paper = matches!(self.stage, Stage::Initial | Stage::Refined);
        match capacity {
            Capacity::Full => Some(1.0),
            Capacity::Device => (!of_the_paper).then_some(2.0),
        }
    }

    /// Says what the mean is, where it is larger than `slack` times what is asked.
    fn short(&self, cells: &Cells, model: Model, capacity: Capacity, slack: f64) -> Option<String> {
        let most = slack * self.factor(capacity)? * self.permille;
        let Self { stage, window, gyro, .. } = *self;
        let key = |place| Key { place, model: model.into(), capacity, window, gyro };
        let keys: Vec<Key> = self.places().into_iter().map(key).collect();
        if keys.iter().any(|key| cells.get(key, stage).is_none()) {
            return None;
        }
        let mean = cells.mean(&keys, stage);
        if mean.is_some_and(|mean| mean <= most) {
            return None;
        }
        let mean = mean.map_or_else(|| "none".to_owned(), |mean| format!("{mean:.3}"));
        Some(format!(
            "{}, {} blades, {}: {mean} permille, {} model, {} memory; asked: {most:.2}",
            self.mount.as_str(),
            self.blades,
            stage.as_str(),
            model_name(model),
            capacity.as_str()
        ))
    }

    fn places(&self) -> Vec<Place> {
        let rpms = SPEEDS_RPM.map(|rpm| rpm as u32).into_iter().filter(|rpm| *rpm >= self.from_rpm);
        let Self { blades, mount, .. } = *self;
        rpms.map(|rpm| Place::One { rpm, blades, distance_cm: 40, mount }).collect()
    }
}

/// The paper's own figures, and ours beyond them.
const ASKED: [Asked; 16] = [
    Asked::paper(Mount::Fixed, 3, Stage::Initial, 7.6),
    Asked::paper(Mount::Handheld, 3, Stage::Initial, 7.6),
    Asked::paper(Mount::Vibrating, 3, Stage::Initial, 7.6),
    Asked::paper(Mount::Fixed, 3, Stage::Refined, 0.31),
    Asked::paper(Mount::Handheld, 3, Stage::Refined, 0.40),
    Asked::paper(Mount::Vibrating, 3, Stage::Refined, 0.37),
    Asked::paper(Mount::Fixed, 2, Stage::Refined, 0.32),
    Asked::paper(Mount::Fixed, 4, Stage::Refined, 0.39),
    Asked { from_rpm: FAST_RPM, ..Asked::paper(Mount::Fixed, 3, Stage::Reading, 0.05) },
    Asked::reading(Mount::Fixed, 3, 0.03),
    Asked::reading(Mount::Handheld, 3, 0.06),
    Asked::reading(Mount::Vibrating, 3, 0.06),
    Asked::reading(Mount::Fixed, 2, 0.05),
    Asked::reading(Mount::Fixed, 4, 0.05),
    Asked::room(false, 0.2),
    Asked::room(true, 0.1),
];

/// How many times as large a mean of few seeds may be: two, of tripod, hand and shaking host, come to 1.2 times what is asked at most.
/// Not all seeds have to be run to see that an estimator has lost a stage.
const OF_FEW_SEEDS: f64 = 2.0;

/// Names each mean that is larger than asked; of what was not measured nothing is said.
pub fn short(cells: &Cells, models: &[Model], seeds: u64) -> Vec<String> {
    let slack = if seeds < SEEDS { OF_FEW_SEEDS } else { 1.0 };
    let all = models.iter().flat_map(|model| Capacity::ALL.map(|capacity| (*model, capacity)));
    all.flat_map(|(model, capacity)| {
        ASKED.iter().filter_map(move |asked| asked.short(cells, model, capacity, slack))
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use evtach_host::synth::{Motion, Scene};

    use super::super::super::score::Score;
    use super::super::cells::Sample;
    use super::*;

    /// Cells of a fixed camera whose readings are so far off, and nothing else.
    fn cells(error: f64, window: Window) -> Cells {
        let scene = Scene::default();
        let motion = Motion::new(&scene);
        let mut cells = Cells::default();
        for place in Asked::reading(Mount::Fixed, 3, 0.0).places() {
            for capacity in Capacity::ALL {
                let model = Model::Edge.into();
                let score = Score { camera: Some(error), window_s: 0.15, ..Score::default() };
                let key = Key { place, model, capacity, window, gyro: false };
                cells.add(key, &Sample::new(score, &scene, &motion, 1e6));
            }
        }
        cells
    }

    #[test]
    fn the_device_may_be_twice_as_far_off() {
        let short_of = |error| short(&cells(error, Window::Adaptive), &[Model::Edge], SEEDS);
        assert_eq!(short_of(29e-6), Vec::<String>::new());
        let one = short_of(59e-6);
        assert!(one.len() == 1 && one[0].contains("0.059 permille, edge model, full"), "{one:?}");
        assert_eq!(short_of(61e-6).len(), 2);
    }

    #[test]
    fn the_mean_of_few_seeds_may_be_twice_as_large() {
        let short_of = |error| short(&cells(error, Window::Adaptive), &[Model::Edge], SEEDS - 1);
        assert_eq!(short_of(59e-6), Vec::<String>::new());
        assert_eq!(short_of(61e-6).len(), 1);
    }

    #[test]
    fn a_mean_without_a_value_falls_short() {
        // The stages have none here; of the device they are not asked.
        let none = short(&cells(0.0, Window::Paper), &[Model::Edge], SEEDS);
        assert!(none.len() == 2 && none.iter().all(|s| s.contains("none permille")), "{none:?}");
    }
}
