//! What stands below the help of each verb.

pub(super) const FABRIG: &str = "\
Examples:
  fabrig demo -o demo.mcap
  fabrig rig face.obj -o face.fabrig
  fabrig animate face.fabrig --motion take.csv -o out.mcap
  fabrig export face.fabrig -o face.glb

Exit codes:
  0 done; 1 failed; 2 wrong usage; 3 stopped early with a whole file, or a gate does not hold";

pub(super) const RIG: &str = "\
Examples:
  fabrig rig face.obj -o face.fabrig --report face.html
  fabrig rig scan.ply -o scan.fabrig --unit m --landmarks points.json
  fabrig rig fused.obj -o face.fabrig --cut-seams mouth,eyes --skin cut.obj
  fabrig rig face.glb -o face.fabrig --shapes face.glb";

pub(super) const ANIMATE: &str = "\
Examples:
  fabrig animate face.fabrig --motion take.csv -o out.mcap
  fabrig animate face.fabrig --motion take.csv -o out.mcap --contact sphincter --sticky-lips
  fabrig animate face.fabrig --motion take.csv -o small.mcap --record skin,weights
  fabrig animate --scene shot.toml -o shot.mcap";

pub(super) const SCENE: &str = "\
Examples:
  fabrig scene show > shot.toml
  fabrig scene check shot.toml";

pub(super) const DEMO: &str = "\
Examples:
  fabrig demo -o demo.mcap --rig demo.fabrig
  fabrig demo --story contact --contact sphincter --pictures . -o contact.mcap";

pub(super) const CHECK: &str = "\
Examples:
  fabrig check face.fabrig --report check.html
  fabrig check face.fabrig --json --gate leak_mm=0.3";

pub(super) const EXPORT: &str = "\
Examples:
  fabrig export face.fabrig -o face.glb
  fabrig export face.fabrig -o take.glb --motion take.csv
  fabrig export face.fabrig -o frames.npz --motion take.csv --baked";

pub(super) const CONVERT: &str = "\
Examples:
  fabrig convert out.mcap --to usd
  fabrig convert out.mcap -o out.glb --rig face.fabrig
  fabrig convert out.mcap --to rrd";

pub(super) const RETARGET: &str = "\
Examples:
  fabrig retarget markers.c3d --rig face.fabrig -o take.csv
  fabrig retarget frames.npy --rig face.fabrig -o take.csv --source-fps 24";

pub(super) const EDIT: &str = "\
Examples:
  fabrig edit list face.fabrig
  fabrig edit export face.fabrig zygomaticus_major_l.mouthSmileLeft -o smile.obj
  fabrig edit import face.fabrig zygomaticus_major_l.mouthSmileLeft smile.obj";

pub(super) const RENDER: &str = "\
Examples:
  fabrig render face.fabrig -o face.png --pose jawOpen=0.6,mouthSmileLeft=0.5
  fabrig render out.mcap -o out.gif
  fabrig render demo -o sheet.png --expressions --size 240";

pub(super) const INFO: &str = "\
Examples:
  fabrig info out.mcap
  fabrig info face.fabrig --json";

pub(super) const TEMPLATE: &str = "\
Examples:
  fabrig template build myrig mytemplate
  fabrig template check mytemplate --picture mytemplate.png";

pub(super) const BENCH: &str = "\
Examples:
  fabrig bench pareto --html pareto.html
  fabrig bench chain --cloth --json";

pub(super) const DOCTOR: &str = "\
Examples:
  fabrig doctor
  fabrig doctor --json";

pub(super) const COMPLETIONS: &str = "\
Examples:
  fabrig completions bash > ~/.local/share/bash-completion/completions/fabrig
  fabrig completions fish > ~/.config/fish/completions/fabrig.fish";

pub(super) const MAN: &str = "\
Examples:
  fabrig man > fabrig.1 && man ./fabrig.1";

pub(super) const PLAY: &str = "\
Examples:
  fabrig play out.mcap
  fabrig play face.fabrig --motion take.csv
  fabrig play face.fabrig --layout face.foxglove.json

Viewers can set the parameters `speed` (0 pauses) and, of a rig, `weights.jawOpen`, ... and
`follow_take`.";

pub(super) const BATCH: &str = "\
Examples:
  fabrig batch manifest.toml -o out
  fabrig batch manifest.toml -o out --dry-run";
