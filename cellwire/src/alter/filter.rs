/// The ball's TRA, ROT and DOM keys, in software (§4): for a ball whose own are not used, or for another device.
///
/// | TRA | ROT | DOM | passes |
/// | --- | --- | --- | --- |
/// | – | – | – | all six axes |
/// | ● | – | – | the three forces |
/// | – | ● | – | the three moments |
/// | – | – | ● | the strongest of the six |
/// | ● | – | ● | the strongest force |
/// | – | ● | ● | the strongest moment |
/// | ● | ● | – / ● | as without both: the source does not give it |
///
/// Of equally strong axes the first of X, Y, Z, MX, MY, MZ passes. Forces and moments are compared by their raw numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Filter {
    /// The axes of the ball that pass.
    pub axes: Axes,
    /// Whether only the strongest of them passes: DOM.
    pub dominant: bool,
}

/// Half of the six axes, or all.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Axes {
    /// All six axes: forces and moments.
    #[default]
    All,
    /// TRA: the forces alone.
    Translation,
    /// ROT: the moments alone.
    Rotation,
}

impl Filter {
    /// Everything passes.
    pub const NONE: Self = Self { axes: Axes::All, dominant: false };

    /// Returns the filter of the three keys.
    pub const fn from_keys(tra: bool, rot: bool, dom: bool) -> Self {
        let axes = match (tra, rot) {
            (true, false) => Axes::Translation,
            (false, true) => Axes::Rotation,
            (false, false) | (true, true) => Axes::All,
        };
        Self { axes, dominant: dom }
    }

    /// Returns X, Y, Z, MX, MY, MZ with 0 for every axis that the filter does not pass.
    pub fn apply(self, [x, y, z, mx, my, mz]: [i16; 6]) -> [i16; 6] {
        let passed = match self.axes {
            Axes::All => [x, y, z, mx, my, mz],
            Axes::Translation => [x, y, z, 0, 0, 0],
            Axes::Rotation => [0, 0, 0, mx, my, mz],
        };
        if !self.dominant {
            return passed;
        }
        let strongest = passed.iter().fold(0, |max, axis| axis.unsigned_abs().max(max));
        let mut found = false;
        passed.map(|axis| {
            let first = !found && axis.unsigned_abs() == strongest;
            found |= first;
            if first { axis } else { 0 }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// §4: ROT "nur der rotatorische Anteil", TRA "nur der translatorische Anteil", DOM "nur die jeweils dominierende
    /// Komponente"; with ROT or TRA that of its half.
    #[test]
    fn the_filter_keeps_the_truth_table() {
        let axes = [3, -90, 4, 5, -100, 100];
        let table = [
            ((false, false, false), axes),
            ((true, false, false), [3, -90, 4, 0, 0, 0]),
            ((false, true, false), [0, 0, 0, 5, -100, 100]),
            ((false, false, true), [0, 0, 0, 0, -100, 0]),
            ((true, false, true), [0, -90, 0, 0, 0, 0]),
            ((false, true, true), [0, 0, 0, 0, -100, 0]),
            ((true, true, false), axes),
            ((true, true, true), [0, 0, 0, 0, -100, 0]),
        ];
        for ((tra, rot, dom), passed) in table {
            assert_eq!(Filter::from_keys(tra, rot, dom).apply(axes), passed, "{tra} {rot} {dom}");
        }
        let dominant = Filter { axes: Axes::All, dominant: true };
        assert_eq!(dominant.apply([127, -128, 0, 0, 0, 0]), [0, -128, 0, 0, 0, 0]);
        assert_eq!(dominant.apply([0; 6]), [0; 6]);
    }
}
