//! Flight logs: the list, and downloads with gaps, doubled blocks and blocks that overtake each other.

use std::time::Duration;

use onecycle_live::{LiveError, LogError};

use crate::vehicle::Scripted;
use crate::world::{Shared, Way, World, connect};

const PATIENCE: Duration = Duration::from_secs(20);

fn bytes(length: usize, seed: u32) -> Vec<u8> {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    };
    (0..length).map(|_| next()).collect()
}

/// Lengths: empty, within a block, whole blocks, more than a window of 46,080 bytes.
const LENGTHS: [usize; 5] = [0, 17, 900, 46_080, 100_001];

fn world() -> Shared {
    let mut scripted = Scripted::ardupilot();
    scripted.logs = LENGTHS
        .iter()
        .map(|&length| bytes(length, length as u32))
        .collect();
    World::of(scripted)
}

fn download(world: &Shared, number: usize, from: u32) -> Result<Vec<u8>, LogError> {
    let mut vehicle = connect(world, None)?;
    let logs = vehicle.logs()?;
    assert_eq!(logs.len(), LENGTHS.len());
    assert_eq!(logs[number].size as usize, LENGTHS[number]);
    let mut got = Vec::new();
    let mut sink = |bytes: &[u8]| {
        got.extend_from_slice(bytes);
        Ok(())
    };
    vehicle.download(&logs[number], from, PATIENCE, &mut sink)?;
    Ok(got)
}

#[test]
fn whole_logs() {
    for number in 0..LENGTHS.len() {
        let world = world();
        let got = download(&world, number, 0).unwrap();
        assert!(got == world.borrow().vehicle.logs[number], "{number}");
    }
}

// It once waited for as long as the vehicle did so.
#[test]
fn a_part_of_the_list_repeated_for_ever() {
    let world = world();
    world.borrow_mut().vehicle.repeats_a_log = true;
    let mut vehicle = connect(&world, None).unwrap();
    let logs = vehicle.logs().unwrap();
    assert_eq!(logs.len(), 1);
    assert!(world.borrow().now < Duration::from_secs(60));
}

// So did a download, whose first block came again and again.
#[test]
fn a_block_repeated_for_ever() {
    let world = world();
    let mut vehicle = connect(&world, None).unwrap();
    let logs = vehicle.logs().unwrap();
    world.borrow_mut().vehicle.repeats_a_log = true;
    let lost = vehicle.download(&logs[4], 0, PATIENCE, &mut |_| Ok(()));
    assert!(matches!(lost, Err(LogError::Live(LiveError::Lost))));
    assert!(world.borrow().now < Duration::from_secs(60));
}

#[test]
fn the_rest_of_a_log() {
    let world = world();
    let got = download(&world, 4, 90_000).unwrap();
    assert!(got == world.borrow().vehicle.logs[4][90_000..]);
}

// A tenth of the blocks is lost, some are doubled, and they overtake each other by up to 60 ms.
#[test]
fn gaps_and_out_of_order() {
    let world = world();
    world.borrow_mut().jitter_ms = 60;
    world.borrow_mut().fate = Box::new(|_, number| match number {
        number if number % 10 == 3 => 0,
        number if number % 17 == 0 => 2,
        _ => 1,
    });
    let got = download(&world, 4, 0).unwrap();
    assert!(got == world.borrow().vehicle.logs[4]);
}

#[test]
fn an_outage_shorter_than_the_patience() {
    let world = world();
    world.borrow_mut().cut = Some((4, Duration::from_secs(10)));
    let got = download(&world, 4, 0).unwrap();
    assert!(got == world.borrow().vehicle.logs[4]);
}

// What came before the link was lost is in order, so that the download goes on from there.
#[test]
fn a_lost_link() {
    let world = world();
    let mut vehicle = connect(&world, None).unwrap();
    let log = vehicle.logs().unwrap()[4];
    let mut got = Vec::new();
    let cut = std::rc::Rc::clone(&world);
    let mut sink = |bytes: &[u8]| {
        got.extend_from_slice(bytes);
        cut.borrow_mut().fate = Box::new(|_, _| 0);
        Ok(())
    };
    let error = vehicle.download(&log, 0, PATIENCE, &mut sink).err();
    assert!(
        matches!(error, Some(LogError::Live(LiveError::Lost))),
        "{error:?}"
    );
    assert!(got.len() == 46_080 && got == world.borrow().vehicle.logs[4][..46_080]);
}

// The log has become shorter since the list.
#[test]
fn a_log_that_ends_early() {
    let world = world();
    let mut vehicle = connect(&world, None).unwrap();
    let log = vehicle.logs().unwrap()[4];
    world.borrow_mut().vehicle.logs[4].truncate(50_000);
    let mut got = 0;
    let mut sink = |bytes: &[u8]| {
        got += bytes.len();
        Ok(())
    };
    let error = vehicle.download(&log, 0, PATIENCE, &mut sink).err();
    assert!(
        matches!(
            error,
            Some(LogError::Short {
                got: 50_000,
                size: 100_001
            })
        ),
        "{error:?}"
    );
    assert_eq!(got, 50_000);
}

#[test]
fn no_logs() {
    let world = World::of(Scripted::px4());
    assert_eq!(connect(&world, None).unwrap().logs().unwrap(), []);
    // A vehicle that does not answer at all.
    let world = World::of(Scripted::px4());
    let mut vehicle = connect(&world, None).unwrap();
    let sent = world.borrow().counts[Way::ToVehicle as usize];
    world.borrow_mut().fate =
        Box::new(move |way, number| usize::from(way == Way::ToUs || number < sent));
    assert!(matches!(vehicle.logs(), Err(LiveError::NoLogs)));
}
