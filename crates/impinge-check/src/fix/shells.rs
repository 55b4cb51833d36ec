//! Turns closed shells that are inside out.

use impinge::Error;

use super::Repairs;
use crate::shells::nested;
use crate::surface::Surface;

/// Turns the shells that are inside out. Returns whether there were any.
///
/// `turned` says of each face whether it is turned already, and is kept up: a shell counts as
/// turned if faces of it are.
pub fn turn(
    surface: &mut Surface,
    threads: usize,
    turned: &mut Vec<bool>,
    repairs: &mut Repairs,
) -> Result<bool, Error> {
    let shells = nested(surface, threads)?;
    repairs.shells = shells.len() as u64;
    turned.resize(surface.faces.len(), false);
    let mut any = false;
    for shell in &shells {
        repairs.cavities += u64::from(shell.is_cavity());
        if shell.sign.is_zero() {
            repairs.flat_shells += 1;
        } else if shell.is_inside_out() {
            any = true;
            for &face in &shell.faces {
                surface.faces[face as usize].swap(1, 2);
                turned[face as usize] ^= true;
            }
        }
        let is_turned = shell.faces.iter().any(|&face| turned[face as usize]);
        repairs.turned_shells += u64::from(is_turned && !shell.sign.is_zero());
    }
    Ok(any)
}
