//! `whatif`: what a change of the scene would do to its cost, its time and its picture.
//!
//! The scene is loaded once and rendered as it is (A) and edited (B), with the same camera and seed and few samples. Counts are
//! compared with intervals from sampling and from the luck of the trees; time comes from uncounted renders in turns, A B B A ….

mod edits;
mod suggest;
mod write;

use crate::args::{FilmArgs, TalkArgs, ViewArgs, parse_seconds};
use crate::fail::{Fail, INTERRUPTED};
use crate::interrupt;
use crate::open::{SceneArgs, default_size};
use crate::output::{Pair, Writer};
use crate::progress::Talker;
use crate::stage::Stage;
use crate::trees;
use clap::Args;
use hotspot_cost::whatif::{Change, SCHEMA};
use hotspot_cost::{
    Document, LayerOptions, Layers, PictureChange, RepeatChange, Side, TreeNoise, TreeSpread, WhatIf,
    compare_over_trees,
};
use hotspot_integrator::{Control, Gather, RenderScene, Rendered, Settings, Stop};
use hotspot_scene::edit::{Edit, apply, has_lights};
use hotspot_scene::{Environment, Scene};
use std::path::PathBuf;

/// `whatif`.
#[derive(Debug, Args)]
#[command(
    mut_arg("size", |arg| arg.help("Size in pixels [default: 480 on the long edge, at the camera's aspect]")),
    mut_arg("max_depth", |arg| {
        arg.help("Most scattering events of a path after the change [default: as before]")
            .default_value("4294967295")
            .hide_default_value(true)
    }),
    mut_arg("adaptive", |arg| arg.hide(true))
)]
pub(crate) struct WhatIfArgs {
    #[command(flatten)]
    pub(crate) open: SceneArgs,
    /// Make a material matte
    #[arg(long, value_name = "MATERIAL", help_heading = "Changes")]
    pub(crate) matte: Vec<String>,
    /// Set the roughness of a material, 0 to 1
    #[arg(long, value_name = "MATERIAL=X", help_heading = "Changes", value_parser = edits::parse_roughness)]
    pub(crate) roughness: Vec<(String, f32)>,
    /// Take an object away
    #[arg(long, value_name = "OBJECT", help_heading = "Changes")]
    pub(crate) delete: Vec<String>,
    /// Move an object by a vector in world space
    #[arg(long = "move", value_name = "OBJECT=x,y,z", help_heading = "Changes", value_parser = edits::parse_move)]
    pub(crate) moves: Vec<(String, [f64; 3])>,
    /// Try what the causes of the hotspots ask for, and rank it; without another change the best is measured in full
    #[arg(long, help_heading = "Changes")]
    pub(crate) suggest: bool,
    /// Begin no further suggestion after so many seconds
    #[arg(long, value_name = "S", default_value_t = 120.0, value_parser = parse_seconds)]
    pub(crate) suggest_seconds: f64,
    /// Most scattering events of a path before the change; another --max-depth is a change
    #[arg(long, value_name = "N", default_value_t = 15)]
    pub(crate) base_max_depth: u32,
    /// Write the edited scene, as .gltf or .glb by its ending
    #[arg(long, value_name = "FILE")]
    pub(crate) write_scene: Option<PathBuf>,
    /// Folder for the outputs
    #[arg(short, long, value_name = "DIR", default_value = "hotspot-out")]
    pub(crate) output: PathBuf,
    #[command(flatten)]
    pub(crate) film: FilmArgs,
    /// Camera samples per pixel, rounded up to even
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(2..))]
    pub(crate) spp: u32,
    /// Pairs of uncounted renders that the time is taken from; 0 leaves time out
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(..=1000))]
    pub(crate) repeats: u32,
    /// Pairs of further trees that tree noise is measured over; 0 leaves it out
    #[arg(long, value_name = "K", default_value_t = 3, value_parser = parse_trees)]
    pub(crate) tree_noise: u32,
    #[command(flatten)]
    pub(crate) views: ViewArgs,
    #[command(flatten)]
    pub(crate) talk: TalkArgs,
}

impl WhatIfArgs {
    /// Most scattering events after the change: the default of `--max-depth` here is the largest number, for as before.
    const fn depth(&self) -> u32 {
        if self.film.max_depth == u32::MAX { self.base_max_depth } else { self.film.max_depth }
    }
}

/// The scene as it is on its stage, and what every render of it has in common.
struct Run<'a> {
    args: &'a WhatIfArgs,
    talker: &'a Talker,
    scene: &'a Scene,
    stage: Stage<'a>,
    options: LayerOptions,
}

/// A version of the scene, counted. `prepared`: `None` for the scene as it is, which the stage holds.
struct Version {
    prepared: Option<RenderScene>,
    settings: Settings,
    layers: Layers,
    document: Document,
    rendered: Rendered,
}

impl Version {
    fn side<'s>(&'s self, name: &'s str) -> Side<'s> {
        Side { name, layers: &self.layers, document: Some(&self.document) }
    }
}

pub(crate) fn run(args: &WhatIfArgs) -> Result<(), Fail> {
    let mut edits = edits::of(args);
    let mut depth = args.depth();
    let changed = !edits.is_empty() || depth != args.base_max_depth;
    if !changed && !args.suggest {
        return Err(Fail::usage(
            "whatif has nothing to change; give --matte, --roughness, --delete, --move, a --max-depth other than \
             --base-max-depth, or --suggest",
        ));
    }
    if args.film.adaptive {
        return Err(Fail::usage(
            "whatif pairs samples pixel by pixel, which --adaptive unpairs; leave it out",
        ));
    }
    if let Some(file) = &args.write_scene {
        write::check(file, &args.open)?;
    }
    let talker = Talker::new(&args.talk);
    let scene = args.open.load()?;
    // Refused before anything is rendered.
    apply(&scene, &edits).map_err(|error| edits::refused(&scene, &error))?;
    let mut writer = Writer::new(&args.output, &args.views)?;
    let film = FilmArgs { max_depth: args.base_max_depth, ..args.film.clone() };
    let mut stage = Stage::new(&scene, &args.open, &film)?;
    if args.film.size.is_none() {
        (stage.width, stage.height) = default_size(&stage.camera, 480.0);
    }
    stage.check_memory(true, 2)?;
    stage.announce(&talker);
    let run = Run { args, talker: &talker, scene: &scene, stage, options: LayerOptions::default() };
    let a = run.version(None, args.base_max_depth)?;

    let mut suggestions = Vec::new();
    if args.suggest {
        let tried = suggest::run(&run, &a)?;
        suggestions = tried.iter().map(|tried| tried.suggestion.clone()).collect();
        suggest::print(&talker, &suggestions);
        if !changed {
            let Some(best) = suggest::best(&tried) else {
                talker.say(if tried.is_empty() {
                    "the causes of the hotspots ask for no change that could be tried"
                } else {
                    "none of the changes tried saves anything for certain"
                });
                return Ok(());
            };
            talker.say(&format!("measuring the best in full: {}", best.suggestion.what));
            (edits, depth) = (best.edits.clone(), best.depth);
        }
    }

    let (edited, change) = run.edited(&edits, depth)?;
    for warning in &change.warnings {
        talker.warn(&format!("note: {warning}"));
    }
    let b = run.version(Some(args.open.prepare(&edited)?), depth)?;
    let mut planes = Layers::new(a.settings.width, a.settings.height);
    // A change of settings alone leaves the tree as it is.
    let noise = if edits.is_empty() || args.tree_noise == 0 {
        None
    } else {
        talker.say(&format!("measuring tree noise over {} further trees", args.tree_noise));
        run.tree_noise(&edited, [&a, &b], &mut planes)?
    };
    let time = run.time([&a, &b], args.repeats)?;
    talker.finish();

    let name_b = format!("{} ({})", run.stage.name, change.what);
    let (side_a, side_b) = (a.side(&run.stage.name), b.side(&name_b));
    let pair = noise.as_ref().map(|noise| (noise, &planes));
    let mut comparison = compare_over_trees(side_a, side_b, false, pair)?;
    SCHEMA.clone_into(&mut comparison.schema);
    let mut whatif = WhatIf {
        comparison,
        scene: run.stage.name.clone(),
        tree: a.document.tree.digest.clone(),
        samples_per_pixel: u64::from(a.settings.spp),
        resolution: [a.settings.width, a.settings.height],
        change,
        image: picture_change(&a.layers, &b.layers),
        tree_noise: noise,
        suggestions,
        ..WhatIf::default()
    };
    if let Some(time) = time {
        whatif.set_time(time, b.rendered.threads);
    }
    let stem = format!("{}.whatif", run.stage.name);
    let pair = Pair {
        stem: &stem,
        verdict: whatif.verdict(),
        json: whatif.to_json(),
        suggestions: &whatif.suggestions,
    };
    writer.shows(crate::seen::names(&run.stage, &a.settings, &a.rendered.frame, &talker));
    let page = run.stage.install(|| writer.pair(&side_a, &side_b, &whatif.comparison, pair))?;
    for file in &page.files {
        talker.say(&format!("wrote {file}"));
    }
    if let Some(file) = &args.write_scene {
        let dark = goes_dark(&scene, &edited).then_some([0.0; 3]);
        talker.say(&write::write(file, &args.open, &edits, dark)?);
        if depth != args.base_max_depth {
            talker.say(
                "note: the depth is a setting of the render: the scene that was written does not hold it",
            );
        }
    }
    for note in &whatif.comparison.notes {
        talker.say(&format!("note: {note}"));
    }
    for line in whatif.change.affected.iter().cloned().chain(whatif.sentences()) {
        talker.say(&line);
    }
    talker.say(&format!("{} → open {}", whatif.verdict(), page.page.display()));
    Ok(())
}

/// Whether an edit takes the last light of a scene that states no environment.
fn goes_dark(scene: &Scene, edited: &Scene) -> bool {
    has_lights(scene) && !has_lights(edited) && scene.environment.is_none()
}

impl Run<'_> {
    /// The scene with edits, and the change in words.
    fn edited(&self, edits: &[Edit], depth: u32) -> Result<(Scene, Change), Fail> {
        let applied = apply(self.scene, edits);
        let (mut edited, met) = applied.map_err(|error| edits::refused(self.scene, &error))?;
        let mut change = edits::described(edits, &met, [self.args.base_max_depth, depth]);
        if goes_dark(self.scene, &edited) {
            // Scenes without any light get a white environment, which is not what the edit asks for.
            edited.environment = Some(Environment::Constant([0.0; 3]));
            change
                .warnings
                .push("no light is left: the edited picture is black, and its paths bring nothing".into());
        }
        Ok((edited, change))
    }

    /// Renders a version, counted in halves.
    fn version(&self, prepared: Option<RenderScene>, depth: u32) -> Result<Version, Fail> {
        let mut settings = self.stage.settings();
        settings.max_depth = depth;
        settings.spp = self.args.spp.next_multiple_of(2);
        settings.intervals = true;
        settings.gather = Gather { time: false, ..Gather::ALL };
        let over = prepared.as_ref().unwrap_or(&self.stage.prepared);
        let rendered = self.render(over, &settings)?;
        let mut document = self.stage.document_over(over, &rendered, &self.options);
        document.settings = self.stage.described(&settings);
        Ok(Version {
            layers: self.stage.layers(&rendered, &self.options),
            document,
            rendered,
            settings,
            prepared,
        })
    }

    /// Interrupted renders compare nothing.
    fn render(&self, prepared: &RenderScene, settings: &Settings) -> Result<Rendered, Fail> {
        let progress = |p| self.talker.progress(p);
        let control =
            Control { cancel: Some(interrupt::flag()), progress: Some(&progress), ..Control::default() };
        let rendered = self.stage.render_over(prepared, settings, control);
        if rendered.stop == Stop::Done {
            Ok(rendered)
        } else {
            Err(Fail::new(INTERRUPTED, "interrupted before the renders were done; nothing was written"))
        }
    }

    /// Both over the same shuffles.
    fn tree_noise(
        &self,
        edited: &Scene,
        versions: [&Version; 2],
        planes: &mut Layers,
    ) -> Result<Option<TreeNoise>, Fail> {
        let options = trees::layers(&self.options);
        let settings = versions.map(|version| trees::settings(&version.settings));
        let mut spread = TreeSpread::new(settings[0].width, settings[0].height);
        for number in 1..=u64::from(self.args.tree_noise) {
            let one = |scene: &Scene, settings: &Settings| -> Result<Layers, Fail> {
                let prepared = self.args.open.prepare_over_tree(scene, Some(number))?;
                Ok(self.stage.layers(&self.render(&prepared, settings)?, &options))
            };
            spread.add_pair(&one(self.scene, &settings[0])?, &one(edited, &settings[1])?);
        }
        Ok(spread.finish_pairs(u64::from(settings[0].spp), planes))
    }

    /// Uncounted renders in turns, so that drift of the machine cancels. Both in the same loop: an edit that takes the last mixed material
    /// out of a scene, say, would else be credited with what eight paths at a time gain.
    fn time(&self, versions: [&Version; 2], repeats: u32) -> Result<Option<RepeatChange>, Fail> {
        let one = |version: &Version, packets: bool| -> Result<Rendered, Fail> {
            let mut settings = version.settings.clone();
            settings.gather = Gather { cost: false, time: false, ..settings.gather };
            settings.packets = packets;
            self.render(version.prepared.as_ref().unwrap_or(&self.stage.prepared), &settings)
        };
        let mut packets = true;
        let mut pairs = Vec::new();
        while pairs.len() < repeats as usize {
            let [a, b] = if pairs.len() % 2 == 1 {
                let b = one(versions[1], packets)?;
                [one(versions[0], packets)?, b]
            } else {
                [one(versions[0], packets)?, one(versions[1], packets)?]
            };
            if a.eights == b.eights {
                pairs.push([a.seconds, b.seconds]);
            } else {
                packets = false;
            }
        }
        Ok(RepeatChange::of(&pairs))
    }
}

fn picture_change(a: &Layers, b: &Layers) -> PictureChange {
    #[cfg_attr(not(feature = "flip"), expect(unused_mut, reason = "FLIP alone adds to it"))]
    let mut change = PictureChange::of(a, b);
    #[cfg(feature = "flip")]
    {
        use hotspot_cost::picture_error::{Picture, flip};
        if let (Ok(a), Ok(b)) = (Picture::of_layers(a, "A"), Picture::of_layers(b, "B")) {
            change.flip = flip(&b, &a);
        }
    }
    change
}

fn parse_trees(text: &str) -> Result<u32, String> {
    match text.parse::<u32>() {
        Ok(n) if n != 1 && n <= 1000 => Ok(n),
        _ => Err("write 0, or a number of trees from 2 to 1000".into()),
    }
}
