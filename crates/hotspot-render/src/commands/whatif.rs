//! `whatif`: what a change of the scene would do to its cost, its time and its picture.
//!
//! The scene is loaded once and rendered as it is (A) and edited (B), with the same camera and seed and few samples. Counts are
//! compared with intervals from sampling and from the luck of the trees; time comes from uncounted renders in turns, A B B A ….

use crate::args::{
    FilmArgs, LightsArg, Roulette, SamplerArg, TalkArgs, ViewArgs, nearest, parse_roulette, parse_size,
};
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
    LayerOptions, Layers, PictureChange, RepeatChange, Side, TreeNoise, TreeSpread, WhatIf,
    compare_over_trees,
};
use hotspot_integrator::{Control, Gather, RenderScene, Rendered, Settings, Stop};
use hotspot_scene::edit::{Affected, Edit, EditError, Named, apply, has_lights};
use hotspot_scene::{Environment, Scene};
use std::path::PathBuf;

/// `whatif`.
#[derive(Debug, Args)]
pub(crate) struct WhatIfArgs {
    #[command(flatten)]
    pub(crate) open: SceneArgs,
    /// Make a material matte
    #[arg(long, value_name = "MATERIAL")]
    pub(crate) matte: Vec<String>,
    /// Set the roughness of a material, 0 to 1
    #[arg(long, value_name = "MATERIAL=X", value_parser = parse_roughness)]
    pub(crate) roughness: Vec<(String, f32)>,
    /// Take an object away
    #[arg(long, value_name = "OBJECT")]
    pub(crate) delete: Vec<String>,
    /// Move an object by a vector in world space
    #[arg(long = "move", value_name = "OBJECT=x,y,z", value_parser = parse_move)]
    pub(crate) moves: Vec<(String, [f64; 3])>,
    /// Most scattering events of a path after the change
    #[arg(long, value_name = "N")]
    pub(crate) max_depth: Option<u32>,
    /// Most scattering events of a path before the change, and after it unless --max-depth changes that
    #[arg(long, value_name = "N", default_value_t = 15)]
    pub(crate) base_max_depth: u32,
    /// Folder for the outputs
    #[arg(short, long, value_name = "DIR", default_value = "hotspot-out")]
    pub(crate) output: PathBuf,
    /// Size in pixels [default: 480 on the long edge, at the camera's aspect]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    pub(crate) size: Option<(u32, u32)>,
    /// Camera samples per pixel, rounded up to even
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(2..))]
    pub(crate) spp: u32,
    /// Pairs of uncounted renders that the time is taken from; 0 leaves time out
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(..=1000))]
    pub(crate) repeats: u32,
    /// Pairs of further trees that tree noise is measured over; 0 leaves it out
    #[arg(long, value_name = "K", default_value_t = 3, value_parser = parse_trees)]
    pub(crate) tree_noise: u32,
    /// Surface vertex (from 0) at which Russian roulette begins, or "off"
    #[arg(long, value_name = "N|off", default_value = "4", value_parser = parse_roulette)]
    pub(crate) roulette: Roulette,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    /// Sample points
    #[arg(long, value_enum, default_value_t = SamplerArg::Sobol)]
    pub(crate) sampler: SamplerArg,
    /// Worker threads [default: all]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub(crate) threads: Option<u32>,
    #[command(flatten)]
    pub(crate) views: ViewArgs,
    #[command(flatten)]
    pub(crate) talk: TalkArgs,
}

impl WhatIfArgs {
    fn edits(&self) -> Vec<Edit> {
        let matte = self.matte.iter().map(|material| Edit::Matte { material: material.clone() });
        let roughness = self.roughness.iter().map(|(material, roughness)| Edit::Roughness {
            material: material.clone(),
            roughness: *roughness,
        });
        let delete = self.delete.iter().map(|object| Edit::Delete { object: object.clone() });
        let moves = self.moves.iter().map(|(object, by)| Edit::Move { object: object.clone(), by: *by });
        matte.chain(roughness).chain(delete).chain(moves).collect()
    }

    fn film(&self) -> FilmArgs {
        FilmArgs {
            size: self.size,
            max_depth: self.base_max_depth,
            roulette: self.roulette,
            seed: self.seed,
            sampler: self.sampler,
            threads: self.threads,
            adaptive: false,
            lights: LightsArg::Power,
        }
    }
}

pub(crate) fn run(args: &WhatIfArgs) -> Result<(), Fail> {
    let edits = args.edits();
    if edits.is_empty() && args.max_depth.is_none_or(|depth| depth == args.base_max_depth) {
        return Err(Fail::usage(
            "whatif has nothing to change; give --matte, --roughness, --delete, --move, or a --max-depth other than \
             --base-max-depth",
        ));
    }
    let talker = Talker::new(&args.talk);
    let scene = args.open.load()?;
    let (mut edited, met) = apply(&scene, &edits).map_err(|error| refused(&scene, &error))?;
    let mut change = described(args, &edits, &met);
    if has_lights(&scene) && !has_lights(&edited) && scene.environment.is_none() {
        // Scenes without any light get a white environment, which is not what the edit asks for.
        edited.environment = Some(Environment::Constant([0.0; 3]));
        change
            .warnings
            .push("no light is left: the edited picture is black, and its paths bring nothing".into());
    }
    let mut writer = Writer::new(&args.output, &args.views)?;
    let film = args.film();
    let mut stage = Stage::new(&scene, &args.open, &film)?;
    if args.size.is_none() {
        (stage.width, stage.height) = default_size(&stage.camera, 480.0);
    }
    stage.check_memory(true, 2)?;
    let over_edited = args.open.prepare(&edited)?;
    stage.announce(&talker);
    for warning in &change.warnings {
        talker.warn(&format!("note: {warning}"));
    }

    let both = Both {
        stage: &stage,
        talker: &talker,
        depths: [args.base_max_depth, args.max_depth.unwrap_or(args.base_max_depth)],
    };
    let mut settings = stage.settings();
    settings.spp = args.spp.next_multiple_of(2);
    settings.intervals = true;
    settings.gather = Gather { time: false, ..Gather::ALL };
    let prepared = [&stage.prepared, &over_edited];
    let [a, b] = both.render(prepared, &settings, false)?;
    let options = LayerOptions::default();
    let layers = [&a, &b].map(|rendered| Layers::from_frame(&rendered.frame, &options));
    let documents = [stage.document(&a, &options), stage.document_over(&over_edited, &b, &options)];

    let mut planes = Layers::new(settings.width, settings.height);
    // A change of settings alone leaves the tree as it is.
    let noise = if edits.is_empty() || args.tree_noise == 0 {
        None
    } else {
        talker.say(&format!("measuring tree noise over {} further trees", args.tree_noise));
        tree_noise(args, &both, [&scene, &edited], (&settings, &options), &mut planes)?
    };
    let time = time(args, &both, prepared, &settings)?;
    talker.finish();

    let name_b = format!("{} ({})", stage.name, change.what);
    let side_a = Side { name: &stage.name, layers: &layers[0], document: Some(&documents[0]) };
    let side_b = Side { name: &name_b, layers: &layers[1], document: Some(&documents[1]) };
    let pair = noise.as_ref().map(|noise| (noise, &planes));
    let mut comparison = compare_over_trees(side_a, side_b, false, pair)?;
    SCHEMA.clone_into(&mut comparison.schema);
    let mut whatif = WhatIf {
        comparison,
        scene: stage.name.clone(),
        samples_per_pixel: u64::from(settings.spp),
        resolution: [settings.width, settings.height],
        change,
        image: picture_change(&layers[0], &layers[1]),
        tree_noise: noise,
        ..WhatIf::default()
    };
    if let Some(time) = time {
        whatif.set_time(time, b.threads);
    }
    let stem = format!("{}.whatif", stage.name);
    let pair = Pair { stem: &stem, verdict: whatif.verdict(), json: whatif.to_json() };
    writer.shows(crate::seen::names(&stage, &settings, &a.frame, &talker));
    let page = writer.pair(&side_a, &side_b, &whatif.comparison, pair)?;
    for file in &page.files {
        talker.say(&format!("wrote {file}"));
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

/// The scene as it is and edited, on one stage.
struct Both<'a> {
    stage: &'a Stage<'a>,
    talker: &'a Talker,
    depths: [u32; 2],
}

impl Both<'_> {
    /// Renders both, B first when `turned`; in the order A, B whichever was first. Interrupted renders compare nothing.
    fn render(
        &self,
        prepared: [&RenderScene; 2],
        settings: &Settings,
        turned: bool,
    ) -> Result<[Rendered; 2], Fail> {
        let cancel = interrupt::flag();
        let progress = |p| self.talker.progress(p);
        let one = |side: usize| {
            let mut settings = settings.clone();
            settings.max_depth = self.depths[side];
            let control = Control { cancel: Some(cancel), progress: Some(&progress), ..Control::default() };
            let rendered = self.stage.render_over(prepared[side], &settings, control);
            if rendered.stop == Stop::Done {
                Ok(rendered)
            } else {
                Err(Fail::new(INTERRUPTED, "interrupted before both renders were done; nothing was written"))
            }
        };
        if turned {
            let b = one(1)?;
            Ok([one(0)?, b])
        } else {
            Ok([one(0)?, one(1)?])
        }
    }
}

/// Both over the same shuffles.
fn tree_noise(
    args: &WhatIfArgs,
    both: &Both<'_>,
    scenes: [&Scene; 2],
    of: (&Settings, &LayerOptions),
    planes: &mut Layers,
) -> Result<Option<TreeNoise>, Fail> {
    let (settings, options) = (trees::settings(of.0), trees::layers(of.1));
    let mut spread = TreeSpread::new(settings.width, settings.height);
    for number in 1..=u64::from(args.tree_noise) {
        let a = args.open.prepare_over_tree(scenes[0], Some(number))?;
        let b = args.open.prepare_over_tree(scenes[1], Some(number))?;
        let [a, b] = both.render([&a, &b], &settings, false)?;
        spread.add_pair(&Layers::from_frame(&a.frame, &options), &Layers::from_frame(&b.frame, &options));
    }
    Ok(spread.finish_pairs(u64::from(settings.spp), planes))
}

/// Uncounted renders in turns, so that drift of the machine cancels.
fn time(
    args: &WhatIfArgs,
    both: &Both<'_>,
    prepared: [&RenderScene; 2],
    settings: &Settings,
) -> Result<Option<RepeatChange>, Fail> {
    let mut settings = settings.clone();
    settings.gather = Gather { cost: false, time: false, ..settings.gather };
    let mut pairs = Vec::new();
    for turn in 0..args.repeats {
        let rendered = both.render(prepared, &settings, turn % 2 == 1)?;
        pairs.push(rendered.map(|r| r.seconds));
    }
    Ok(RepeatChange::of(&pairs))
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

/// Unknown names get the nearest one that there is.
fn refused(scene: &Scene, error: &EditError) -> Fail {
    let EditError::Unknown { named, name } = error else { return Fail::usage(error.to_string()) };
    let names: Vec<&str> = match named {
        Named::Object => scene.objects.iter().map(|o| o.name.as_str()).collect(),
        Named::Material => scene.materials.iter().map(|m| m.name.as_str()).collect(),
    };
    let hint = match nearest(name, names.iter().copied()) {
        Some(near) => format!("did you mean \"{near}\"?"),
        None => {
            let some: Vec<String> = names.iter().take(12).map(|name| format!("\"{name}\"")).collect();
            let more = if names.len() > some.len() { ", …" } else { "" };
            format!("it has {}{more}", some.join(", "))
        }
    };
    Fail::usage(format!("the scene has no {named} \"{name}\"; {hint}"))
}

fn described(args: &WhatIfArgs, edits: &[Edit], met: &[Affected]) -> Change {
    let mut change = Change::default();
    let mut words: Vec<String> = Vec::new();
    for (edit, met) in edits.iter().zip(met) {
        words.push(edit.to_string());
        change.options.push(match edit {
            Edit::Matte { material } => format!("--matte {material}"),
            Edit::Roughness { material, roughness } => format!("--roughness {material}={roughness}"),
            Edit::Delete { object } => format!("--delete {object}"),
            Edit::Move { object, by: [x, y, z] } => format!("--move {object}={x},{y},{z}"),
        });
        change.affected.push(format!("{edit}: {} triangles of {} objects", met.triangles, met.objects));
        if met.instances == 0 {
            change.warnings.push(format!("{edit}: nothing in the scene is made of it"));
        }
        if met.lights_removed {
            change.warnings.push(format!("{edit}: it gave light, which is gone"));
        }
        if met.lights_moved {
            change.warnings.push(format!("{edit}: it gives light, which moves with it"));
        }
        if !met.namesakes.is_empty() {
            change.warnings.push(format!("{edit}: {} stay as they are", met.namesakes.join(", ")));
        }
    }
    if let Some(depth) = args.max_depth {
        words.push(format!("depth at most {depth}"));
        change.options.push(format!("--max-depth {depth}"));
        change.affected.push(format!("depth at most {depth} in place of {}", args.base_max_depth));
    }
    change.what = words.join(", ");
    change
}

fn parse_roughness(text: &str) -> Result<(String, f32), String> {
    let parsed = text.rsplit_once('=').and_then(|(name, x)| Some((name.to_owned(), x.parse::<f32>().ok()?)));
    match parsed {
        Some((name, x)) if (0.0..=1.0).contains(&x) && !name.is_empty() => Ok((name, x)),
        _ => Err("write a material and a roughness from 0 to 1, such as Glass=0.3".into()),
    }
}

fn parse_move(text: &str) -> Result<(String, [f64; 3]), String> {
    let parsed = text.rsplit_once('=').and_then(|(name, by)| {
        let by: Vec<f64> = by.split(',').map(|c| c.trim().parse().ok()).collect::<Option<_>>()?;
        Some((name.to_owned(), <[f64; 3]>::try_from(by).ok()?))
    });
    match parsed {
        Some((name, by)) if by.iter().all(|c| c.is_finite()) && !name.is_empty() => Ok((name, by)),
        _ => Err("write an object and a vector, such as \"Left wall=0.5,0,0\"".into()),
    }
}

fn parse_trees(text: &str) -> Result<u32, String> {
    match text.parse::<u32>() {
        Ok(n) if n != 1 && n <= 1000 => Ok(n),
        _ => Err("write 0, or a number of trees from 2 to 1000".into()),
    }
}
