// 'kiroku compare': a plan beside the recording of the operation.
#include <memory>

#include "apps/common/time_option.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/sim/comparison_check.h"
#include "apps/sim/comparison_making.h"
#include "apps/sim/comparison_request.h"
#include "apps/sim/plan_command.h"

namespace kiroku::apps {

void add_compare_command(Command& program) {
  Command& command = program.add_command("compare", "shows a plan beside the recording of the operation");
  const auto request = std::make_shared<ComparisonRequest>();
  command.argument("CASE", request->named, "case folder, or identifier of a case in the home's archive");
  command.argument("PLAN", request->plan, "the plan or the breathing lung (.json), or its seal (.seal.json)");
  command.option("-o,--output", "OUT", request->output,
                 "where to: .mp4 (a film of both), .html (a page with figures and pictures), .json (figures)",
                 "kept in the home, where kiroku view shows it in the case");
  command.option("--name", "NAME", request->name, "what a comparison that is kept is called",
                 "the plan file's name");
  command.option("--verify", "FILE", request->verified,
                 "tells whether a comparison (.json) still fits its case and plan, instead of making one");
  command.option("--by-hand", "FILE", request->by_hand,
                 "JSON: steps matched by hand, points of the organ and tools picked in the pictures; - is "
                 "standard input",
                 "steps are found by the marks of the recording");
  command.option("--write-by-hand", "FILE", request->write_by_hand,
                 "writes the steps that were found, to be edited and given with --by-hand");
  command.writes("--write-by-hand");
  command.flag("--steps", request->steps,
               "tells the planned steps and what of them was marked, instead of comparing");
  command.option("--stream", "STREAM", request->stream, "which recorded pictures",
                 "endoscope, or the only ones");
  command.option("-i,--identity", "FILE", request->identities,
                 "a recipient's identity; in a --demo home its own");
  command.choice("--show", {"beside", "overlay", "wipe", "difference", "checkerboard", "contour"},
                 request->form,
                 "the plan beside the recording, over it, or left of a line in it; with --geometry also the "
                 "difference, squares of both, edges of the plan's radiograph",
                 "beside");
  command.option("--share", "SHARE", request->share,
                 "opacity of the plan laid over, or where the line is (0 to 1)", "0.5");
  command.option("--from", "T", request->from, kTimeHelp, "a second before the first step");
  command.option("--to", "T", request->to, "likewise", "a second after the last step");
  command.option("--speed", "FACTOR", request->speed, "of the film", "1");
  command.option("--width", "PIXELS", request->width, "of each of the two pictures",
                 "the recording's, at most 640");
  command.option("--volume", "CT", request->volume,
                 "the CT to be shown where the plan names none: every output says that it is not the plan's; "
                 "another one than the plan's is refused");
  command.option("--series", "UID", request->series,
                 "of a folder with several series: its UID, or how that ends");
  command.option("--transfer", "NAME", request->transfer, "how tissue looks (kiroku sim transfer)", "liver");
  command.option("--view", "FROM", request->view,
                 "front, back, left, right, head, feet, or AZIMUTH,ELEVATION in degrees", "front");
  command.option("--zoom", "FACTOR", request->zoom, "larger than what fits", "1");
  command.choice("--gpu", {"auto", "off"}, request->gpu,
                 "off computes pictures without a graphics processor, the same everywhere", "auto");
  command.option(
      "-g,--geometry", "FILE", request->geometry,
      "how the fluoroscope sees the patient (kiroku sim drr): the plan's radiographs are compared with "
      "the case's fluoroscopy, and the film shows them");
  command.option("--fluoroscopy", "STREAM", request->fluoroscopy, "which recorded pictures these are",
                 "the only stream whose purpose is fluoroscopy");
  command.option(
      "--align-at", "T", request->align_at,
      "moves the patient as a rigid body until the picture at this time and the plan's are most alike");
  command.choice("--polarity", {"bone-black", "bone-white"}, request->polarity, "of the fluoroscopy",
                 "bone-black");
  command.choice(
      "--align", {"off", "auto"}, request->align,
      "auto lays the plan's organ on the recorded pictures without a click, by its outline and its "
      "texture: where it is in each, with a standard error, or that it is lost; needs --field or --lens, "
      "and looks from --view or up to 75 degrees aside",
      "off");
  command.choice(
      "--organ", {"rigid", "deformed"}, request->organ,
      "with --align: deformed also deforms the organ until it falls onto what a picture shows, while the "
      "endoscope stands still; a picture that this explains no better keeps the rigid organ, with the "
      "reason; ten "
      "minutes at most",
      "rigid");
  command.choice(
      "--colours", {"rest", "plan"}, request->colours,
      "with --organ deformed, of a film: how far the organ was displaced from rest, or how far it "
      "departs from where the plan has it at that moment, where that is beyond two standard errors",
      "rest");
  command.option("--field", "DEGREES", request->field,
                 "with --align: the angle that the lesser side of the recorded pictures covers, of a lens "
                 "without distortion");
  command.option("--lens", "FILE", request->lens,
                 "with --align, instead of --field: the endoscope's lens, as OpenCV's calibration writes it "
                 "(YAML, XML or JSON: camera_matrix, distortion_coefficients, image_width, image_height)");
  command.option(
      "--purpose", "P", request->purpose,
      "of what -o or --write-by-hand writes, what for: teaching, research or another purpose of the site's; "
      "a consent to it must stand");
  command.option("--made-by", "NAME", request->made_by, "who compares", "the user of this machine");
  command.option("--asked-by", "NAME", request->asked_by,
                 "for whom a program compares; stands in the appliance log after the user of this machine");
  command.choice("--progress", {"line", "json"}, request->progress,
                 "json: what is being done, for programs: an object a line on standard error", "line");
  command.option(
      "--identity-socket", "N", request->identity_socket,
      "descriptor of a socket over which a program that holds the identity is asked for file keys");
  command.option("--authority", "NAME", request->authorities, "asks only this authority of kiroku.toml");
  add_root_options(command, request->roots, "with --verify: ");
  add_home_option(command, request->home);
  command.flag("-f,--force", request->force, "replaces what is there");
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "A step is found where its name was marked while recording ('clip the artery', or 'step 3'); 'done' "
      "beside it "
      "ends it, 'pause' and 'resume' interrupt it. Beside every output the document OUT.comparison.json says "
      "what was "
      "matched, "
      "by whom, of which case and which plan; its hash is entered into the appliance log and time-stamped "
      "(OUT.comparison.AUTHORITY.tsr). The case is only read. Exit status: 0 made and time-stamped, "
      "self-issued "
      "(then a warning says so) or not, 3 made without a time-stamp; "
      "with --verify 0 all holds, 1 something differs, 3 something could not be checked.");
  command.explain(
      "A breathing lung is compared with the case's fluoroscopy: how the pictures say that it breathed, when "
      "the plan's breath began in them, and in each picture how far the tumour was seen from where the plan "
      "has it, across the ray. It takes --volume, --geometry (else STREAM.geometry.json of the home), "
      "--fluoroscopy, --from, --to and --polarity, and -o OUT.json. A series in which no breathing is found "
      "is refused, with the numbers.");
  command.example(
      "kiroku compare 20260805T091502Z-3f9c21ab lung.seal.json --volume ct/ -g c-arm.json -o lung.json",
      "did the lung breathe as it was planned?");
  command.example("kiroku compare 20260805T091502Z-3f9c21ab liver.seal.json",
                  "for the viewer: the plan beside the recording, in step");
  command.example("kiroku compare 20260805T091502Z-3f9c21ab liver.seal.json -o liver.html",
                  "a page for people: order, times, vital signs, pictures of each step");
  command.example("kiroku compare 20260805T091502Z-3f9c21ab liver.seal.json -o liver.mp4",
                  "a film of both, in step");
  command.example(
      "kiroku compare 20260805T091502Z-3f9c21ab liver.seal.json --align auto --field 60 --show overlay -o "
      "laid.mp4",
      "the plan over the organ, wherever the endoscope goes");
  command.example(
      "kiroku compare 20260805T091502Z-3f9c21ab liver.seal.json --align auto --field 60 --organ deformed "
      "--show overlay -o pulled.mp4",
      "the organ as it is pulled, its displacement as colour");
  command.example(
      "kiroku compare 20260805T091502Z-3f9c21ab liver.seal.json --align auto --lens endoscope.yml --show "
      "overlay -o laid.mp4",
      "through a lens whose distortion is known");
  command.example("kiroku compare 20260805T091502Z-3f9c21ab liver.seal.json --verify liver.comparison.json",
                  "does the comparison still fit?");
  command.on_run(
      [request] { return request->verified ? verify_comparison(*request) : make_comparison(*request); });
}

}  // namespace kiroku::apps
