//! Ports: what groups tell each other of their paired nodes, in one array for all.

use crate::cloth::constraints::attachment::{PairEnd, PairVector};

/// The ports of all groups, one group after the other.
#[derive(Debug, Clone, Default)]
pub(crate) struct Ports {
    /// Predicted displacement of each from its target. (mm)
    pub(super) displacements: Vec<PairVector>,
    /// What each brings into its pairs.
    pub(super) ends: Vec<PairEnd>,
    /// How often the masses of each group have changed; for these its ends hold.
    pub(super) versions: Vec<u64>,
    /// How many ports each group has.
    counts: Vec<usize>,
}

/// The ports of one group.
#[derive(Debug)]
pub(crate) struct OwnPorts<'a> {
    pub(super) displacements: &'a mut [PairVector],
    pub(super) ends: &'a mut [PairEnd],
    pub(super) version: &'a mut u64,
}

impl<'a> OwnPorts<'a> {
    /// No ports, for groups without pairs.
    pub(crate) fn none(version: &'a mut u64) -> Self {
        Self {
            displacements: &mut [],
            ends: &mut [],
            version,
        }
    }
}

impl Ports {
    /// Ports of groups that have `counts` of them.
    pub(crate) fn new(counts: Vec<usize>) -> Self {
        let count = counts.iter().sum();
        Self {
            displacements: vec![PairVector::default(); count],
            ends: vec![PairEnd::default(); count],
            versions: vec![0; counts.len()],
            counts,
        }
    }

    /// Whether no group has any.
    pub(crate) fn is_empty(&self) -> bool {
        self.displacements.is_empty()
    }

    /// Those of each group, for it to write.
    pub(crate) fn split(&mut self) -> Vec<OwnPorts<'_>> {
        let mut displacements = self.displacements.as_mut_slice();
        let mut ends = self.ends.as_mut_slice();
        let groups = self.counts.iter().zip(&mut self.versions);
        groups
            .map(|(&count, version)| OwnPorts {
                displacements: displacements.split_off_mut(..count).unwrap_or_default(),
                ends: ends.split_off_mut(..count).unwrap_or_default(),
                version,
            })
            .collect()
    }
}
