//! What a call costs through the C interfaces: `cargo bench -p acceptance --bench fmi_calls`.
//! Medians of many batches, in nanoseconds.
#![allow(unsafe_code, reason = "C functions of a library are called")]

use std::{
    ffi::{CString, c_char, c_void},
    fs::File,
    ptr,
    time::Instant,
};

use fmi_import::{Causality, Fmu, Instance, Isolation, Kind, Options};
use libloading::{Library, Symbol};
use pack::{FmiVersion, PackedFmu, all_fmus};

type Handle = *mut c_void;
type Instantiate = unsafe extern "C" fn(
    *const c_char,
    *const c_char,
    *const c_char,
    bool,
    bool,
    bool,
    bool,
    *const u32,
    usize,
    Handle,
    Handle,
    Handle,
) -> Handle;
type EnterInitialization = unsafe extern "C" fn(Handle, bool, f64, f64, bool, f64) -> i32;
type Simple = unsafe extern "C" fn(Handle) -> i32;
type Get = unsafe extern "C" fn(Handle, *const u32, usize, *mut f64, usize) -> i32;
type Set = unsafe extern "C" fn(Handle, *const u32, usize, *const f64, usize) -> i32;
type DoStep =
    unsafe extern "C" fn(Handle, f64, f64, bool, *mut bool, *mut bool, *mut bool, *mut f64) -> i32;

const BATCH: u32 = 2000;
const BATCHES: usize = 201;

fn median(mut batch: impl FnMut()) -> f64 {
    let mut times: Vec<f64> = (0..BATCHES)
        .map(|_| {
            let start = Instant::now();
            batch();
            start.elapsed().as_secs_f64() * 1e9 / f64::from(BATCH)
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[BATCHES / 2]
}

fn measure(fmu: &PackedFmu) -> Result<(), Box<dyn std::error::Error>> {
    let folder = tempfile::tempdir()?;
    zip::ZipArchive::new(File::open(&fmu.path)?)?.extract(folder.path())?;
    let description = fmi_rs::model_description::fmi3::ModelDescription::from_path(
        &folder.path().join("modelDescription.xml"),
    )?;
    let of = |causality: &str| -> Vec<u32> {
        let variables = description.modelVariables.iter();
        variables
            .filter(|v| format!("{:?}", v.causality) == causality)
            .map(|v| v.valueReference)
            .collect()
    };
    let (inputs, outputs) = (of("Input"), of("Output"));
    let binary = format!("{}{}", fmu.name, std::env::consts::DLL_SUFFIX);
    let path = folder.path().join(fmu.version.binaries()).join(binary);
    let token = CString::new(description.instantiationToken.as_str())?;
    // SAFETY: the workspace's own library; signatures are those of the standard, and all arrays
    // have the lengths given.
    unsafe {
        let library = Library::new(path)?;
        let instantiate: Symbol<Instantiate> = library.get("fmi3InstantiateCoSimulation")?;
        let enter: Symbol<EnterInitialization> = library.get("fmi3EnterInitializationMode")?;
        let exit: Symbol<Simple> = library.get("fmi3ExitInitializationMode")?;
        let reset: Symbol<Simple> = library.get("fmi3Reset")?;
        let get: Symbol<Get> = library.get("fmi3GetFloat64")?;
        let set: Symbol<Set> = library.get("fmi3SetFloat64")?;
        let do_step: Symbol<DoStep> = library.get("fmi3DoStep")?;
        let free: Symbol<unsafe extern "C" fn(Handle)> = library.get("fmi3FreeInstance")?;

        let (none, no_list) = (ptr::null_mut(), ptr::null());
        let path = ptr::null();
        let handle = instantiate(
            c"bench".as_ptr(),
            token.as_ptr(),
            path,
            false,
            false,
            false,
            false,
            no_list,
            0,
            none,
            none,
            none,
        );
        let start = || {
            reset(handle);
            enter(handle, false, 0.0, 0.0, false, 0.0);
            assert_eq!(exit(handle), 0);
        };
        let mut value = [0.001; 16];
        start();
        let set_one = median(|| {
            for _ in 0..BATCH {
                set(handle, inputs.as_ptr(), 1, value.as_ptr(), 1);
            }
        });
        let get_one = median(|| {
            for _ in 0..BATCH {
                get(handle, outputs.as_ptr(), 1, value.as_mut_ptr(), 1);
            }
        });
        let (mut event, mut end, mut early, mut last) = (false, false, false, 0.0);
        let step = median(|| {
            start();
            for k in 0..BATCH {
                let t = f64::from(k) * 0.002;
                let status = do_step(
                    handle, t, 0.002, true, &mut event, &mut end, &mut early, &mut last,
                );
                assert_eq!(status, 0);
            }
        });
        println!(
            "{:24} set {set_one:6.1} ns   get {get_one:6.1} ns   doStep {step:6.1} ns",
            fmu.name
        );
        free(handle);
    }
    Ok(())
}

/// What the master pays for a call: in this process, and of an FMU in another (for which the
/// program has to be built).
fn measure_isolated(fmu: &PackedFmu) -> Result<(), Box<dyn std::error::Error>> {
    let opened = Fmu::open(&fmu.path)?;
    let description = &opened.description;
    let reference = |causality| {
        let mut all = description
            .of(causality)
            .map(|at| &description.variables[at]);
        let scalar = all.find(|variable| variable.kind == Kind::Float64);
        scalar.map(|variable| variable.reference)
    };
    let (Some(input), Some(output)) = (reference(Causality::Input), reference(Causality::Output))
    else {
        return Ok(());
    };
    for (isolation, place) in [
        (Isolation::None, "in this process"),
        (Isolation::All, "in another process"),
    ] {
        let options = Options {
            isolation,
            ..Options::default()
        };
        let mut instance = Instance::new(&opened, "bench", &options)?;
        instance.enter_initialization(0.0, 1e6)?;
        instance.exit_initialization()?;
        let mut value = [0.0];
        let mut failed = None;
        let get = median(|| {
            for _ in 0..BATCH {
                failed = failed
                    .take()
                    .or(instance.get(&Kind::Float64, &[output], &mut value).err());
            }
        });
        let mut k = 0;
        let step = median(|| {
            for _ in 0..BATCH {
                let set = instance.set(&Kind::Float64, &[input], &[0.0]);
                let step = instance.do_step(f64::from(k) * 0.002, 0.002);
                failed = failed.take().or(set.err()).or(step.err());
                k += 1;
            }
        });
        if let Some(error) = failed {
            return Err(error);
        }
        println!(
            "{:24} {place:20} get {get:8.1} ns   set and doStep {step:8.1} ns",
            fmu.name
        );
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let all = all_fmus()?.into_iter();
    let third: Vec<_> = all.filter(|fmu| fmu.version == FmiVersion::V3).collect();
    for fmu in &third {
        measure(fmu)?;
    }
    for fmu in third.iter().filter(|fmu| fmu.name == "ShakeTable") {
        measure_isolated(fmu)?;
    }
    Ok(())
}
