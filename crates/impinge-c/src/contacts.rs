//! Where triangles meet, and how deep bodies overlap: `impinge_find_contacts`,
//! `impinge_find_penetration`.

use std::sync::OnceLock;

use impinge::Stats;
use impinge::contact::{Contacts, Curves, Penetration, Region, Shape};

use crate::answers::{Answer, answer, impinge_pairs};
use crate::arrays::{self, collect};
use crate::detector::impinge_detector;
use crate::questions::question;
use crate::scene::impinge_scene;
use crate::stats::Texts;
use crate::status::{Failure, held};
use crate::types::*;

/// Where the triangles of each pair meet.
pub struct impinge_contacts {
    contacts: Contacts,
    rows: Vec<impinge_pair>,
    shapes: Vec<u8>,
    starts: Vec<u64>,
    hash: u64,
    /// Found when a column of them is first looked at.
    curves: OnceLock<Option<CurveColumns>>,
    stats: Stats,
    texts: Texts,
}

struct CurveColumns {
    curves: Curves,
    starts: Vec<u64>,
    are_closed: Vec<u8>,
    lengths: Vec<f64>,
}

fn wide(starts: &[usize]) -> Result<Vec<u64>, Failure> {
    collect(starts.iter().map(|&start| start as u64), "contacts")
}

impl impinge_contacts {
    fn new(contacts: Contacts, hash: u64, stats: Stats) -> Result<Self, Failure> {
        let rows = contacts.rows().iter().map(|&row| row.into());
        let shapes = contacts.shapes().iter().map(|shape| match shape {
            Shape::Solid => SHAPE_SOLID,
            Shape::Apart => SHAPE_EMPTY,
            Shape::Point => SHAPE_POINT,
            Shape::Segment => SHAPE_SEGMENT,
            Shape::Polygon => SHAPE_POLYGON,
        });
        Ok(impinge_contacts {
            rows: collect(rows, "contacts")?,
            shapes: collect(shapes, "contacts")?,
            starts: wide(contacts.starts())?,
            contacts,
            hash,
            curves: OnceLock::new(),
            stats,
            texts: Texts::default(),
        })
    }

    /// The curves; `None` if there is no memory for them.
    fn curves(&self) -> Option<&CurveColumns> {
        let find = || {
            let curves = self.contacts.curves().ok()?;
            let each = 0..curves.len();
            let are_closed = each.clone().map(|curve| curves.is_closed(curve).into());
            Some(CurveColumns {
                starts: wide(curves.starts()).ok()?,
                are_closed: collect(are_closed, "curves").ok()?,
                lengths: collect(each.map(|curve| curves.length(curve)), "curves").ok()?,
                curves,
            })
        };
        self.curves.get_or_init(find).as_ref()
    }
}

impl Answer for impinge_contacts {
    type Row = impinge_pair;
    const NAME: &'static str = "contacts";
    fn rows(&self) -> &[impinge_pair] {
        &self.rows
    }
    fn column(&self, column: u32) -> Option<impinge_array> {
        let view = match column {
            COLUMN_ROWS => arrays::field::<_, u32>(&self.rows, 0),
            COLUMN_SHAPE => arrays::view_of(&self.shapes),
            COLUMN_STARTS => arrays::view_of(&self.starts),
            COLUMN_CORNERS => arrays::view_of(self.contacts.all_corners()),
            COLUMN_CONTACT_POINTS => arrays::view(self.contacts.points()),
            COLUMN_CURVE_STARTS => arrays::view_of(&self.curves()?.starts),
            COLUMN_CURVE_POINTS => arrays::view_of(self.curves()?.curves.all_points()),
            COLUMN_CURVE_CLOSED => arrays::view_of(&self.curves()?.are_closed),
            COLUMN_CURVE_LENGTH => arrays::view_of(&self.curves()?.lengths),
            _ => return None,
        };
        Some(view)
    }
    fn stats(&self) -> (&Stats, &Texts) {
        (&self.stats, &self.texts)
    }
}

answer!(
    impinge_contacts,
    impinge_contacts_count,
    impinge_contacts_data,
    impinge_contacts_column,
    impinge_contacts_stats,
    impinge_contacts_destroy
);

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_contacts_hash(contacts: *const impinge_contacts) -> u64 {
    // SAFETY: see `answer!`.
    unsafe { contacts.as_ref() }.map_or(0, |contacts| contacts.hash)
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_find_contacts(
    detector: *mut impinge_detector,
    scene: *const impinge_scene,
    pairs: *const impinge_pairs,
    contacts: *mut *mut impinge_contacts,
) -> Status {
    let about = (detector, scene, std::ptr::null());
    // SAFETY: see `answer!`.
    unsafe {
        question(about, (contacts, "contacts"), |of| {
            let pairs = &held(pairs, "pairs")?.pairs;
            let found = of.detector.contacts(&of.scene.scene, pairs)?;
            impinge_contacts::new(found, pairs.hash(), of.detector.stats().clone())
        })
    }
}

/// How deep two closed bodies are in each other.
pub struct impinge_penetration {
    penetration: Penetration,
    rows: Vec<impinge_region>,
    stats: Stats,
    texts: Texts,
}

fn region_row(region: &Region) -> impinge_region {
    impinge_region {
        position: region.position,
        bounds: region.bounds,
        length: region.length,
        patch_area: region.patch_area,
        area: region.area,
        normal: region.normal.unwrap_or_default(),
        depth: region.depth.unwrap_or(f64::NAN),
        volume: region.volume.unwrap_or(f64::NAN),
        body_a: region.bodies[0],
        body_b: region.bodies[1],
        n_contacts: region.contacts.len() as u64,
        n_inside: region.inside.each_ref().map(|inside| inside.len() as u64),
    }
}

impl Answer for impinge_penetration {
    type Row = impinge_region;
    const NAME: &'static str = "penetration";
    fn rows(&self) -> &[impinge_region] {
        &self.rows
    }
    fn column(&self, column: u32) -> Option<impinge_array> {
        match column {
            COLUMN_INSIDE_A => Some(arrays::view_of(&self.penetration.inside[0])),
            COLUMN_INSIDE_B => Some(arrays::view_of(&self.penetration.inside[1])),
            _ => None,
        }
    }
    fn stats(&self) -> (&Stats, &Texts) {
        (&self.stats, &self.texts)
    }
}

answer!(
    impinge_penetration,
    impinge_penetration_count,
    impinge_penetration_data,
    impinge_penetration_column,
    impinge_penetration_stats,
    impinge_penetration_destroy
);

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_penetration_volume(
    penetration: *const impinge_penetration,
) -> f64 {
    // SAFETY: see `answer!`.
    let penetration = unsafe { penetration.as_ref() };
    penetration
        .and_then(|held| held.penetration.volume())
        .unwrap_or(f64::NAN)
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn impinge_find_penetration(
    detector: *mut impinge_detector,
    scene: *const impinge_scene,
    contacts: *const impinge_contacts,
    a: u32,
    b: u32,
    penetration: *mut *mut impinge_penetration,
) -> Status {
    let about = (detector, scene, std::ptr::null());
    // SAFETY: see `answer!`.
    unsafe {
        question(about, (penetration, "penetration"), |of| {
            let contacts = &held(contacts, "contacts")?.contacts;
            let [a, b] = [of.scene.id(a)?, of.scene.id(b)?];
            let scene = &of.scene.scene;
            let found = of.detector.penetration(scene, contacts, a, b)?;
            let rows = collect(found.regions.iter().map(region_row), "regions of contact")?;
            Ok::<_, Failure>(impinge_penetration {
                penetration: found,
                rows,
                stats: of.detector.stats().clone(),
                texts: Texts::default(),
            })
        })
    }
}
