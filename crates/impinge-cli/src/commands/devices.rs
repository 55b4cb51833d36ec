//! `impinge devices`: lists GPUs.

use std::io::Write;

use crate::args::DevicesArgs;
use crate::error::Error;
use crate::output::{out, table};
use crate::report;
use crate::text::shown_bytes;

/// Lists adapters, hardware first.
pub fn devices(args: &DevicesArgs) -> Result<(), Error> {
    let devices = impinge::devices();
    if args.json {
        let list = devices.into_iter().map(|device| report::Device {
            name: device.name,
            interface: device.interface,
            driver: device.driver,
            is_software: device.is_software,
            max_binding: device.max_binding,
        });
        return report::print(&report::Devices(list.collect())).map_err(Error::Output);
    }
    if devices.is_empty() {
        writeln!(out(), "no GPU and no software driver").map_err(Error::Output)?;
        return Ok(());
    }
    let rows = devices.iter().map(|device| {
        vec![
            device.name.clone(),
            device.interface.clone(),
            device.driver.clone(),
            if device.is_software {
                "software"
            } else {
                "hardware"
            }
            .to_owned(),
            shown_bytes(device.max_binding),
        ]
    });
    let header = ["name", "interface", "driver", "made of", "largest binding"];
    let text = table(&header, &[0, 1, 2, 3], rows);
    writeln!(out(), "{text}").map_err(Error::Output)
}
