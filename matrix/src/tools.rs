//! What of other people's the matrix runs on: where it is, which version it is, what installs it,
//! and under which licence it comes. Nothing of it is part of Hankel.

use std::collections::BTreeSet;
use std::env;
use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::thread;
use std::time::Duration;

use hankel_system::process::which;
use hankel_system::temporary::Folder;
use serde::{Deserialize, Serialize};

use crate::process::run;

/// Something that columns need.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Tool {
    /// A Vulkan driver, as the loader finds it.
    Vulkan,
    /// SwiftShader's Vulkan driver.
    SwiftShader,
    /// An EGL without a display, with OpenGL ES.
    Egl,
    /// glslang's command line.
    Glslang,
    /// DXC, as a program or a library.
    Dxc,
    /// clang++.
    Clang,
    /// Node.js.
    Node,
    /// The npm package `webgpu`: Dawn for Node.js.
    Dawn,
    /// Chromium, or a browser that is made of it.
    Chromium,
    /// Slang's compiler.
    Slang,
}

/// Version of the npm package `webgpu` that is asked for.
const DAWN_VERSION: &str = "0.6.2";

/// The PyPI source distribution that carries DXC's library, and the library in it.
const DXC_PACKAGE: &str = "compushady-0.17.5";
const DXC_LIBRARY: &str = "libdxcompiler_x86_64.so.3.7";
const DXC_SHA256: &str = "fb549976da7abff1ee56bdfa4f5ab156b95e971d4270b5b4447b61682d105809";

/// The PyPI package that carries slangc.
const SLANG_PACKAGE: &str = "slangtorch-1.3.22";

/// The driver around DXC's library.
const DXC_DRIVER: &str = include_str!("dxc.cpp");

/// How long a tool may take to say its version.
const PROBE: Duration = Duration::from_secs(10);

/// How long the driver of DXC's library may take to be made.
const LIMIT: Duration = Duration::from_secs(60);

/// Where one is, or what would install it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Status {
    /// Which.
    pub tool: Tool,
    /// Its name for people.
    pub name: String,
    /// What the matrix uses it for.
    pub purpose: String,
    /// Its licence.
    pub licence: String,
    /// The file with the licence's text on this machine, if it is where its package puts it.
    pub licence_file: Option<PathBuf>,
    /// Where it is.
    pub path: Option<PathBuf>,
    /// Its version, as it says itself.
    pub version: Option<String>,
    /// Sizes and times of its files: results are kept only as long as these are the same.
    pub files: Vec<String>,
    /// Why it cannot be used, if it is not simply missing.
    pub problem: Option<String>,
    /// The command that installs it.
    pub install: String,
}

impl Status {
    /// Whether it can be used.
    #[must_use]
    pub const fn is_there(&self) -> bool {
        self.path.is_some() && self.problem.is_none()
    }
}

/// DXC.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Dxc {
    /// Its own command line.
    Program(PathBuf),
    /// Its library behind our driver.
    Library {
        /// The driver.
        driver: PathBuf,
        /// The library.
        library: PathBuf,
    },
}

impl Dxc {
    /// A command that compiles; further arguments of DXC may follow.
    #[must_use]
    pub fn command(&self, source: &Path, entry: &str, profile: &str, out: &Path) -> Command {
        match self {
            Self::Program(dxc) => {
                let mut command = Command::new(dxc);
                command.args(["-T", profile, "-E", entry, "-Fo"]);
                command.args([out, source]);
                command
            }
            Self::Library { driver, library } => {
                let mut command = Command::new(driver);
                command.args([library, source]).args([entry, profile]);
                command.arg(out);
                command
            }
        }
    }
}

/// Where tools are looked for.
#[derive(Clone, Debug)]
pub struct Tools {
    /// What the set-up puts here: `node_modules`, DXC's library, and the driver made for it.
    pub folder: PathBuf,
}

impl Tool {
    /// All of them.
    pub const ALL: [Self; 10] = [
        Self::Vulkan,
        Self::SwiftShader,
        Self::Egl,
        Self::Glslang,
        Self::Dxc,
        Self::Clang,
        Self::Node,
        Self::Dawn,
        Self::Chromium,
        Self::Slang,
    ];

    /// The name on the command line and in messages.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Vulkan => "Vulkan driver",
            Self::SwiftShader => "SwiftShader",
            Self::Egl => "EGL and OpenGL ES",
            Self::Glslang => "glslangValidator",
            Self::Dxc => "DXC",
            Self::Clang => "clang++",
            Self::Node => "Node.js",
            Self::Dawn => "Dawn for Node.js",
            Self::Chromium => "Chromium",
            Self::Slang => "slangc",
        }
    }

    const fn purpose(self) -> &'static str {
        match self {
            Self::Vulkan => "runs SPIR-V, WGSL, and what GLSL and HLSL compile to",
            Self::SwiftShader => "runs SPIR-V with other arithmetic; Dawn and Chromium run on it",
            Self::Egl => "compiles and runs GLSL ES",
            Self::Glslang => "compiles GLSL 4.50, and HLSL as a second opinion",
            Self::Dxc => "compiles HLSL",
            Self::Clang => "compiles MSL as C++, with a stand-in for Metal's library",
            Self::Node => "runs Dawn, and serves Chromium its page",
            Self::Dawn => "runs WGSL through Tint",
            Self::Chromium => "runs WGSL in a page",
            Self::Slang => "compiles modules of functions in Slang, in the tests",
        }
    }

    const fn licence(self) -> &'static str {
        match self {
            Self::Vulkan => "Mesa: MIT",
            Self::SwiftShader => "Apache-2.0",
            Self::Egl => "Mesa: MIT",
            Self::Glslang => "BSD-3-Clause and others",
            Self::Dxc => "University of Illinois/NCSA; the package around it: MIT",
            Self::Clang => "Apache-2.0 with LLVM exceptions",
            Self::Node => "MIT and others",
            Self::Dawn => "MIT; Dawn: BSD-3-Clause",
            Self::Chromium => "BSD-3-Clause and others",
            Self::Slang => "Apache-2.0 with LLVM exceptions",
        }
    }

    /// Where the text of the licence is after [`Self::install`].
    fn licence_file(self, tools: &Tools) -> PathBuf {
        let of_debian = |package: &str| Path::new("/usr/share/doc").join(package).join("copyright");
        match self {
            Self::Vulkan => of_debian("mesa-vulkan-drivers"),
            // Its driver comes in Chromium's package.
            Self::SwiftShader | Self::Chromium => of_debian("chromium"),
            Self::Egl => of_debian("libegl-mesa0"),
            Self::Glslang => of_debian("glslang-tools"),
            Self::Clang => of_debian("clang-19"),
            Self::Node => of_debian("nodejs"),
            Self::Dawn => tools.folder.join("node_modules/webgpu/LICENSE.md"),
            Self::Dxc => tools.folder.join("compushady-LICENSE"),
            Self::Slang => tools
                .slang()
                .join(format!("{SLANG_PACKAGE}.dist-info/licenses/LICENSE")),
        }
    }

    fn install(self, tools: &Tools) -> String {
        let folder = tools.folder.display();
        match self {
            Self::Vulkan => "apt-get install libvulkan1 mesa-vulkan-drivers".into(),
            Self::SwiftShader | Self::Chromium => "apt-get install chromium".into(),
            Self::Egl => "apt-get install libegl1 libgles2".into(),
            Self::Glslang => "apt-get install glslang-tools".into(),
            Self::Dxc => format!(
                "pip download --no-deps --no-binary :all: --dest {folder} {} && \
                 tar -xzf {folder}/{DXC_PACKAGE}.tar.gz -C {folder} --strip-components=3 \
                 {DXC_PACKAGE}/compushady/backends/{DXC_LIBRARY}",
                DXC_PACKAGE.replacen('-', "==", 1)
            ),
            Self::Clang => "apt-get install clang-19".into(),
            Self::Node => "apt-get install nodejs npm".into(),
            Self::Dawn => {
                format!("npm install --no-save --prefix {folder} webgpu@{DAWN_VERSION}")
            }
            Self::Slang => format!(
                "pip download --no-deps --only-binary :all: --dest {folder} {} && \
                 python3 -m zipfile -e {folder}/{SLANG_PACKAGE}-*.whl {folder}/slang && \
                 chmod +x {folder}/slang/slangtorch/bin/slangc",
                SLANG_PACKAGE.replacen('-', "==", 1)
            ),
        }
    }
}

impl Tools {
    /// Tools in the folder that HANKEL_TOOLS names, or else in `tools` of Hankel's cache; without
    /// either, of the present folder.
    #[must_use]
    pub fn of_cache(cache: Option<&Path>) -> Self {
        let folder = variable("HANKEL_TOOLS")
            .or_else(|| Some(cache?.join("tools")))
            .unwrap_or_else(|| "tools".into());
        Self { folder }
    }

    /// Looks for several at a time: one that hangs delays none of the others.
    #[must_use]
    pub fn statuses(&self, wanted: &[Tool]) -> Vec<Status> {
        thread::scope(|scope| {
            let probes: Vec<_> = wanted
                .iter()
                .map(|&tool| {
                    let name = "probe".to_owned();
                    let probe = thread::Builder::new().name(name);
                    // Without a thread, in turn.
                    probe
                        .spawn_scoped(scope, move || self.status(tool))
                        .map_err(|_| tool)
                })
                .collect();
            probes
                .into_iter()
                .map(|probe| match probe {
                    Ok(thread) => thread
                        .join()
                        .unwrap_or_else(|panic| std::panic::resume_unwind(panic)),
                    Err(tool) => self.status(tool),
                })
                .collect()
        })
    }

    /// Looks for one.
    #[must_use]
    pub fn status(&self, tool: Tool) -> Status {
        let mut status = Status {
            tool,
            name: tool.name().into(),
            purpose: tool.purpose().into(),
            licence: tool.licence().into(),
            licence_file: Some(tool.licence_file(self)).filter(|file| file.is_file()),
            path: None,
            version: None,
            files: Vec::new(),
            problem: None,
            install: tool.install(self),
        };
        match self.find(tool) {
            Ok(Some((path, version))) => {
                status.files = stamps(&files_of(tool, &path));
                status.path = Some(path);
                status.version = Some(version);
            }
            Ok(None) => {}
            Err(problem) => status.problem = Some(problem),
        }
        status
    }

    /// Where one is and its version; an error for one that is there and cannot be used.
    fn find(&self, tool: Tool) -> Result<Option<(PathBuf, String)>, String> {
        let said = |found: Option<PathBuf>, arguments: &[&str]| {
            found
                .map(|path| version(&path, arguments).map(|v| (path, v)))
                .transpose()
        };
        match tool {
            Tool::Vulkan => Ok(vulkan_driver().map(|p| {
                let version = manifest_version(&p);
                (p, version)
            })),
            Tool::SwiftShader => Ok(self.swiftshader().map(|p| {
                let version = manifest_version(&p);
                (p, version)
            })),
            Tool::Egl => Ok(library("libEGL.so.1")
                .filter(|_| library("libGLESv2.so.2").is_some())
                .map(|p| {
                    let version = real_name(&p);
                    (p, version)
                })),
            Tool::Glslang => said(self.glslang(), &["--version"]),
            Tool::Dxc => self.dxc_status(),
            Tool::Clang => said(self.clang(), &["--version"]),
            Tool::Node => said(program(&["node"], "HANKEL_NODE"), &["--version"]),
            Tool::Dawn => self.dawn(),
            Tool::Chromium => said(self.chromium(), &["--version"]),
            Tool::Slang => said(self.slangc(), &["-version"]),
        }
    }

    /// glslang's program.
    #[must_use]
    pub fn glslang(&self) -> Option<PathBuf> {
        program(&["glslangValidator", "glslang"], "HANKEL_GLSLANG")
    }

    /// clang's program for C++: 19 first, which is what is tested.
    #[must_use]
    pub fn clang(&self) -> Option<PathBuf> {
        let names = [
            "clang++-19",
            "clang++-20",
            "clang++-21",
            "clang++-18",
            "clang++-17",
            "clang++",
        ];
        program(&names, "HANKEL_CLANG")
    }

    /// Node.js.
    #[must_use]
    pub fn node(&self) -> Option<PathBuf> {
        program(&["node"], "HANKEL_NODE")
    }

    /// Slang's compiler: a system's, or the one that the set-up puts into the tools' folder.
    #[must_use]
    pub fn slangc(&self) -> Option<PathBuf> {
        program(&["slangc"], "HANKEL_SLANGC").or_else(|| {
            let own = self.slang().join("slangtorch/bin/slangc");
            (variable("HANKEL_SLANGC").is_none() && own.is_file()).then_some(own)
        })
    }

    /// Where the package with Slang's compiler is unpacked.
    fn slang(&self) -> PathBuf {
        self.folder.join("slang")
    }

    /// The browser.
    #[must_use]
    pub fn chromium(&self) -> Option<PathBuf> {
        let names = [
            "chromium",
            "chromium-browser",
            "google-chrome",
            "google-chrome-stable",
        ];
        program(&names, "HANKEL_CHROMIUM")
    }

    /// The manifest of SwiftShader's driver, which comes with Chromium.
    #[must_use]
    pub fn swiftshader(&self) -> Option<PathBuf> {
        if let Some(path) = variable("HANKEL_SWIFTSHADER") {
            return path.is_file().then_some(path);
        }
        [
            "/usr/lib/chromium",
            "/usr/lib/chromium-browser",
            "/opt/google/chrome",
        ]
        .iter()
        .map(|folder| Path::new(folder).join("vk_swiftshader_icd.json"))
        .find(|path| path.is_file())
    }

    /// Folder of npm's packages.
    #[must_use]
    pub fn node_modules(&self) -> PathBuf {
        self.folder.join("node_modules")
    }

    fn dawn(&self) -> Result<Option<(PathBuf, String)>, String> {
        let package = self.node_modules().join("webgpu");
        let file = package.join("package.json");
        let Ok(text) = fs::read_to_string(&file) else {
            return Ok(None);
        };
        let version = serde_json::from_str::<serde_json::Value>(&text)
            .ok()
            .and_then(|v| Some(v.get("version")?.as_str()?.to_owned()))
            .ok_or_else(|| format!("{} names no version", file.display()))?;
        Ok(Some((package, version)))
    }

    /// DXC, ready to be run: where there is only the library, its driver is made with a C++
    /// compiler, once.
    ///
    /// # Errors
    /// In words: it is not there, it is another library than is known, the driver cannot be made.
    pub fn dxc(&self) -> Result<Dxc, String> {
        if let Some(dxc) = program(&["dxc"], "HANKEL_DXC") {
            return Ok(Dxc::Program(dxc));
        }
        let library = self.folder.join(DXC_LIBRARY);
        let bytes = fs::read(&library).map_err(|e| format!("{}: {e}", library.display()))?;
        let found = hankel_codegen::files::sha256(&bytes);
        if found != DXC_SHA256 {
            return Err(format!(
                "{} has the SHA-256 {found}, not {DXC_SHA256}: install it again",
                library.display()
            ));
        }
        let hash = hankel_codegen::files::sha256(DXC_DRIVER.as_bytes());
        let driver = self.folder.join(format!("dxc-{}", &hash[..16]));
        if !driver.is_file() {
            self.make_driver(&driver)?;
        }
        Ok(Dxc::Library { driver, library })
    }

    /// Compiles the driver; it appears whole or not at all.
    fn make_driver(&self, driver: &Path) -> Result<(), String> {
        let compiler = program(&["c++", "g++", "clang++", "clang++-19"], "CXX")
            .ok_or("there is no C++ compiler for the driver of DXC's library: install g++")?;
        let work = Folder::within(&self.folder).map_err(|e| e.to_string())?;
        let (source, made) = (work.join("dxc.cpp"), work.join("dxc"));
        fs::write(&source, DXC_DRIVER).map_err(|e| e.to_string())?;
        let mut command = Command::new(&compiler);
        command.args(["-O1", "-std=c++17", "-o"]);
        command.args([&made, &source]).arg("-ldl");
        let done = run(&mut command, LIMIT).map_err(|e| e.to_string())?;
        if !done.status.success() {
            return Err(format!(
                "{} does not compile the driver of DXC's library: {}",
                compiler.display(),
                done.words()
            ));
        }
        fs::rename(&made, driver).map_err(|e| format!("{}: {e}", driver.display()))
    }

    fn dxc_status(&self) -> Result<Option<(PathBuf, String)>, String> {
        let there = program(&["dxc"], "HANKEL_DXC").is_some();
        if !there && !self.folder.join(DXC_LIBRARY).is_file() {
            return Ok(None);
        }
        Ok(Some(match self.dxc()? {
            Dxc::Program(path) => {
                let v = version(&path, &["--version"])?;
                (path, v)
            }
            Dxc::Library { driver, library } => {
                let mut command = Command::new(&driver);
                command.args([library.as_os_str(), "--version".as_ref()]);
                let done = run(&mut command, PROBE).map_err(|e| e.to_string())?;
                if !done.status.success() {
                    return Err(done.words());
                }
                (
                    library,
                    format!("libdxcompiler {} ({DXC_PACKAGE})", done.stdout.trim()),
                )
            }
        }))
    }
}

/// A path that an environment variable gives.
fn variable(name: &str) -> Option<PathBuf> {
    env::var_os(name)
        .filter(|v| !v.is_empty())
        .map(PathBuf::from)
}

/// The first of some programs that is there; the variable's where it is set.
fn program(names: &[&str], override_: &str) -> Option<PathBuf> {
    if let Some(path) = variable(override_) {
        return if path.components().count() > 1 {
            path.is_file().then_some(path)
        } else {
            which(&path)
        };
    }
    names.iter().find_map(|name| which(Path::new(name)))
}

/// The first line that names a version.
fn version(program: &Path, arguments: &[&str]) -> Result<String, String> {
    let done = run(Command::new(program).args(arguments), PROBE).map_err(|e| e.to_string())?;
    let words = done.words();
    words
        .lines()
        .find(|line| line.contains(|c: char| c.is_ascii_digit()))
        .map(|line| line.trim().to_owned())
        .filter(|_| done.status.success())
        .ok_or_else(|| format!("{} does not say its version: {words}", program.display()))
}

/// The manifest of the Vulkan driver that the loader would take first.
fn vulkan_driver() -> Option<PathBuf> {
    for name in ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"] {
        if let Some(list) = env::var_os(name).filter(|v| !v.is_empty()) {
            return env::split_paths(&list).find(|p| p.is_file());
        }
    }
    let mut found: Vec<PathBuf> = [
        "/etc/vulkan/icd.d",
        "/usr/local/share/vulkan/icd.d",
        "/usr/share/vulkan/icd.d",
    ]
    .iter()
    .filter_map(|folder| fs::read_dir(folder).ok())
    .flatten()
    .filter_map(|entry| Some(entry.ok()?.path()))
    .filter(|p| p.extension().is_some_and(|e| e == "json"))
    .collect();
    found.sort();
    // Which of several answers shows when the device is opened.
    found
        .iter()
        .find(|p| p.to_string_lossy().contains("lvp"))
        .or(found.first())
        .cloned()
}

/// The files that a tool at `path` is, as far as they are known.
fn files_of(tool: Tool, path: &Path) -> Vec<PathBuf> {
    let mut all = vec![path.to_owned()];
    match tool {
        Tool::Vulkan | Tool::SwiftShader => {
            all.extend(driver_library(path));
            all.extend(library("libvulkan.so.1"));
        }
        Tool::Egl => {
            all.extend(library("libEGL_mesa.so.0"));
            all.extend(library("libGLESv2.so.2"));
            all.extend(
                ["swrast_dri.so", "libgallium_dri.so"]
                    .iter()
                    .filter_map(|name| library(&format!("dri/{name}"))),
            );
        }
        Tool::Dawn => all.push(path.join("dist")),
        _ => {}
    }
    all
}

/// The library that a driver's manifest names.
fn driver_library(manifest: &Path) -> Option<PathBuf> {
    let text = fs::read_to_string(manifest).ok()?;
    let value: serde_json::Value = serde_json::from_str(&text).ok()?;
    let named = value.get("ICD")?.get("library_path")?.as_str()?;
    if named.contains('/') {
        // From the manifest's folder, unless it is absolute.
        Some(manifest.parent()?.join(named))
    } else {
        library(named)
    }
}

/// Stamps of files and of all shared libraries that they are linked with: a driver's compiler is
/// one of these.
fn stamps(files: &[PathBuf]) -> Vec<String> {
    let mut all: BTreeSet<PathBuf> = BTreeSet::new();
    for file in files {
        all.insert(file.clone());
        all.extend(linked(file));
    }
    all.iter().map(|f| stamp(f)).collect()
}

/// The shared libraries that a program or library is linked with, as the system's loader finds
/// them; none for what is neither.
fn linked(file: &Path) -> Vec<PathBuf> {
    let is_elf = fs::File::open(file).is_ok_and(|mut opened| {
        let mut magic = [0; 4];
        opened.read_exact(&mut magic).is_ok() && magic == *b"\x7fELF"
    });
    if !is_elf {
        return Vec::new();
    }
    let Ok(done) = run(Command::new("ldd").arg(file), LIMIT) else {
        return Vec::new();
    };
    done.stdout
        .lines()
        .filter_map(|line| {
            // `libLLVM-15.so.1 => /lib/x86_64-linux-gnu/libLLVM-15.so.1 (0x00007f…)`
            let path = line.split_once("=> ")?.1.split(" (").next()?.trim();
            path.starts_with('/').then(|| path.into())
        })
        .collect()
}

/// A file's size and time.
fn stamp(file: &Path) -> String {
    let about = fs::metadata(file).ok().map(|m| {
        let time = m.modified().ok();
        let since = time.and_then(|t| t.duration_since(std::time::UNIX_EPOCH).ok());
        (m.len(), since.map_or(0, |d| d.as_nanos()))
    });
    match about {
        Some((bytes, time)) => format!("{} {bytes} {time}", file.display()),
        None => file.display().to_string(),
    }
}

/// The Vulkan version that a driver's manifest names.
fn manifest_version(manifest: &Path) -> String {
    fs::read_to_string(manifest)
        .ok()
        .and_then(|text| serde_json::from_str::<serde_json::Value>(&text).ok())
        .and_then(|v| Some(v.get("ICD")?.get("api_version")?.as_str()?.to_owned()))
        .map_or_else(|| "of unknown version".into(), |v| format!("Vulkan {v}"))
}

/// A shared library where loaders look.
fn library(name: &str) -> Option<PathBuf> {
    let machine = format!("/usr/lib/{}-linux-gnu", env::consts::ARCH);
    let own = env::var_os("LD_LIBRARY_PATH").unwrap_or_default();
    env::split_paths(&own)
        .chain([&machine, "/usr/lib64", "/usr/lib"].map(PathBuf::from))
        .map(|folder| folder.join(name))
        .find(|path| path.exists())
}

/// A library's name with its full version.
fn real_name(path: &Path) -> String {
    let real = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    real.file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_os = "linux")]
    fn what_a_program_is_linked_with_is_stamped() {
        let own = env::current_exe().unwrap();
        let all = stamps(std::slice::from_ref(&own));
        assert!(
            all.iter()
                .any(|s| s.starts_with(&own.display().to_string()))
        );
        assert!(all.iter().any(|s| s.contains("/libc.so.6 ")), "{all:?}");
        let folder = tempfile::tempdir().unwrap();
        let text = folder.path().join("driver.json");
        fs::write(&text, "{}").unwrap();
        assert_eq!(stamps(&[text]).len(), 1);
    }
}
