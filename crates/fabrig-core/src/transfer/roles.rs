//! Which of a template's shapes do what a sum of straight lines cannot: found by name once,
//! used by index everywhere else. A template that lacks one simply lacks that behaviour.

use serde::{Deserialize, Serialize};

use crate::template::Template;

/// Shapes that move the mandible, as indices in [`Template::shapes`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct JawShapes {
    /// Turns it open.
    pub open: Option<u32>,
    /// Closes the lips while it is open.
    pub close: Option<u32>,
    /// Slides it forward.
    pub forward: Option<u32>,
    /// Slides it to the character's left.
    pub left: Option<u32>,
    /// Slides it to the character's right.
    pub right: Option<u32>,
}

/// Shapes of one eye, as indices in [`Template::shapes`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct EyeShapes {
    /// Closes the lids.
    pub blink: Option<u32>,
    /// Turns the eyeball up, down, towards the nose, away from it; the order of
    /// [`crate::template::EyeSocket::look_angles`].
    pub look: [Option<u32>; 4],
}

fn find(template: &Template, name: &str) -> Option<u32> {
    template.shape_index(name).map(|i| i as u32)
}

impl JawShapes {
    /// Finds the shapes by name.
    pub fn of(template: &Template) -> Self {
        Self {
            open: find(template, "jawOpen"),
            close: find(template, "mouthClose"),
            forward: find(template, "jawForward"),
            left: find(template, "jawLeft"),
            right: find(template, "jawRight"),
        }
    }
}

impl EyeShapes {
    /// Finds the shapes of the left and the right eye by name.
    pub fn of(template: &Template) -> [Self; 2] {
        ["Left", "Right"].map(|side| Self {
            blink: find(template, &format!("eyeBlink{side}")),
            look: ["Up", "Down", "In", "Out"]
                .map(|way| find(template, &format!("eyeLook{way}{side}"))),
        })
    }
}
