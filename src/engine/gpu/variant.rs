//! What programs are specialised for: the kernel's files, and override constants.

use super::source::kernel_name;
use gridfall_core::material::Law;
use gridfall_core::material::parameters::Elasticity;
use gridfall_core::sim::setup::{Axis, ContactKind, Kernel, Material, Setup, Transfer};
use gridfall_core::sim::{touch, volume};

/// Names of the laws, by their number in `wgsl/shared/state.wgsl`.
pub const LAWS: [&str; 10] = [
    "fixed-corotated",
    "neo-hookean",
    "fluid",
    "stvk-hencky",
    "von-mises-hencky",
    "von-mises-fixed-corotated",
    "drucker-prager",
    "nacc",
    "snow",
    "mohr-coulomb",
];

/// Those that work on F itself.
const CLOSED: u32 = 0b111;
const ALL: u32 = (1 << LAWS.len()) - 1;

/// The number by which shaders know a law.
pub fn law_number(material: &Material) -> u32 {
    match Law::<f64>::new(material) {
        Law::FixedCorotated(_) => 0,
        Law::NeoHookean(_) => 1,
        Law::WeaklyCompressibleFluid(_) => 2,
        Law::StvkHencky(_) => 3,
        Law::VonMises(l) if l.elasticity == Elasticity::Hencky => 4,
        Law::VonMises(_) => 5,
        Law::DruckerPrager(_) => 6,
        Law::Nacc(_) => 7,
        Law::Snow(_) => 8,
        Law::MohrCoulomb(_) => 9,
    }
}

/// How nodes know what fills them (`FILLS_*` in the shaders).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum Fills {
    /// Nobody asks.
    Nothing = 0,
    /// By their mass: there is one density.
    Mass = 1,
    /// By the rest volumes.
    Volume = 2,
}

impl Fills {
    pub fn of(setup: &Setup) -> Self {
        let follows = setup.bodies.iter().any(|body| volume::relaxation(setup, body).is_some());
        match (follows, volume::is_mixed(setup)) {
            (false, _) => Self::Nothing,
            (true, false) => Self::Mass,
            (true, true) => Self::Volume,
        }
    }
}

/// What of its surroundings a scene's particles and nodes have to do with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Surroundings {
    pub fills: Fills,
    /// Some collider acts on particles.
    pub touches: bool,
    pub colliders: bool,
    pub sticky_walls: bool,
    /// Walls that let material slide.
    pub other_walls: bool,
}

impl Surroundings {
    /// All that there are.
    pub const FULL: Self =
        Self { fills: Fills::Volume, touches: true, colliders: true, sticky_walls: true, other_walls: true };
    /// None.
    pub const PLAIN: Self =
        Self { fills: Fills::Nothing, touches: false, colliders: false, sticky_walls: false, other_walls: false };
    /// Of one material whose volume follows what fills the room, between sticky walls.
    pub const BASIN: Self = Self { fills: Fills::Mass, sticky_walls: true, ..Self::PLAIN };

    fn of(setup: &Setup) -> Self {
        let walls = |sticky: bool| {
            let is = move |kind| (kind == ContactKind::Sticky) == sticky;
            setup.axes.iter().any(|axis| matches!(axis, Axis::Walls(walls) if walls.iter().any(|wall| is(wall.kind))))
        };
        Self {
            fills: Fills::of(setup),
            touches: touch::acts(setup),
            colliders: !setup.colliders.is_empty(),
            sticky_walls: walls(true),
            other_walls: walls(false),
        }
    }

    fn name(self) -> String {
        match self {
            Self::FULL => "full".into(),
            Self::PLAIN => "plain".into(),
            Self::BASIN => "basin".into(),
            other => format!("{other:?}"),
        }
    }
}

/// What programs are specialised for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Variant {
    pub kernel: Kernel,
    /// Never PIC, which the GPU engines do not have.
    pub transfer: Transfer,
    /// Laws that the scene has, a bit each.
    pub laws: u32,
    pub surroundings: Surroundings,
}

impl Variant {
    pub fn of(setup: &Setup) -> Self {
        Self {
            kernel: setup.kernel,
            transfer: match (setup.kernel, setup.transfer) {
                // A single grid is centred anyway.
                (Kernel::Compact, transfer) => transfer,
                (_, Transfer::MlsPublished) => Transfer::Mls,
                (_, transfer) => transfer,
            },
            laws: setup.materials.iter().fold(0, |laws, material| laws | 1 << law_number(material)),
            surroundings: Surroundings::of(setup),
        }
    }

    /// For programs that differ by little more than the kernel, or take long to compile: one for scenes whose laws
    /// all work on F itself, one for all others.
    #[must_use]
    pub fn coarse(self) -> Self {
        let laws = if self.laws & !CLOSED == 0 { CLOSED } else { ALL };
        Self { laws, surroundings: Surroundings::FULL, ..self }
    }

    /// For all laws, in all surroundings.
    pub fn full(kernel: Kernel, transfer: Transfer) -> Self {
        Self { kernel, transfer, laws: ALL, surroundings: Surroundings::FULL }
    }

    /// For programs that differ by kernel alone.
    pub fn of_kernel(kernel: Kernel) -> Self {
        Self::full(kernel, Transfer::Apic)
    }

    /// Of each scheme, those that tests and tables know of the many that there can be.
    pub fn samples() -> impl Iterator<Item = Self> {
        let (plain, basin) = (Surroundings::PLAIN, Surroundings::BASIN);
        let samples = [(1, plain), (1 << 2, plain), (1 << 2, basin), (1 << 6, basin)];
        let of = move |laws, surroundings| move |full: Self| Self { laws, surroundings, ..full };
        let each = move |full: Self| samples.map(|(laws, around)| of(laws, around)(full)).into_iter().chain([full]);
        Self::schemes().flat_map(each)
    }

    /// All that [`Self::coarse`] comes to.
    pub fn coarse_ones() -> impl Iterator<Item = Self> {
        Self::schemes().flat_map(|full| [CLOSED, ALL].map(|laws| Self { laws, ..full }))
    }

    fn schemes() -> impl Iterator<Item = Self> {
        use Kernel::{Compact, Quadratic};
        use Transfer::{Apic, Mls, MlsPublished};
        let schemes = [(Compact, Mls), (Compact, MlsPublished), (Compact, Apic), (Quadratic, Mls), (Quadratic, Apic)];
        schemes.into_iter().map(|(kernel, transfer)| Self::full(kernel, transfer))
    }

    /// As in `compact mls fluid basin`.
    pub fn name(self) -> String {
        let transfer = match self.transfer {
            Transfer::Pic => "pic",
            Transfer::Apic => "apic",
            Transfer::Mls => "mls",
            Transfer::MlsPublished => "mls-published",
        };
        let known = |(k, name): (usize, &&str)| (self.laws & (1 << k) != 0).then(|| name.to_string());
        let laws = match self.laws {
            CLOSED => "closed".to_string(),
            ALL => "all".into(),
            _ => LAWS.iter().enumerate().filter_map(known).collect::<Vec<_>>().join("+"),
        };
        format!("{} {transfer} {laws} {}", kernel_name(self.kernel), self.surroundings.name())
    }

    /// Values of override constants, of which a shader has some.
    pub fn constants(self, workgroup: u32) -> [(&'static str, f64); 9] {
        let flag = |on: bool| f64::from(u8::from(on));
        let around = self.surroundings;
        [
            ("WORKGROUP", f64::from(workgroup)),
            ("MLS", flag(self.transfer.is_mls())),
            ("CENTRED", flag(self.transfer.is_centred())),
            ("LAWS", f64::from(self.laws)),
            ("FILLS", f64::from(around.fills as u32)),
            ("TOUCHES", flag(around.touches)),
            ("COLLIDERS", flag(around.colliders)),
            ("WALLS_STICKY", flag(around.sticky_walls)),
            ("WALLS_HELD", flag(around.other_walls)),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_tell_variants_apart() {
        let names: std::collections::HashSet<_> = Variant::samples().map(Variant::name).collect();
        assert_eq!(names.len(), Variant::samples().count());
        assert!(names.contains("compact mls fluid basin"), "{names:?}");
    }

    #[test]
    fn coarse_variants_are_few() {
        let ones: Vec<_> = Variant::coarse_ones().collect();
        assert!(Variant::samples().all(|variant| ones.contains(&variant.coarse())));
    }
}
