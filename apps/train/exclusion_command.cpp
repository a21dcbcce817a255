#include <algorithm>
#include <array>
#include <cmath>
#include <iostream>
#include <memory>
#include <numeric>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/common/step_line.h"
#include "apps/common/time_option.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/sim/number_option.h"
#include "apps/train/attempt_numbers.h"
#include "apps/train/attempt_seal.h"
#include "apps/train/output_folder.h"
#include "apps/train/train_command.h"
#include "apps/train/training_body.h"
#include "apps/train/udp_hand.h"
#include "base/error.h"
#include "base/number_text.h"
#include "media/film_writer.h"
#include "sim/haptics/plugin_device.h"
#include "sim/haptics/udp_device.h"
#include "sim/model/body_model.h"
#include "sim/render/lettering.h"
#include "trainer/exclusion/simulated_trainee.h"
#include "trainer/report/score_json.h"
#include "trainer/results/training_database.h"
#include "viewer/http/disk_room.h"

namespace kiroku::apps {
namespace {

using Json = nlohmann::ordered_json;

struct Request {
  std::string output, hand;
  std::string fingers = "3", vertices = "2000", seconds = "60", size = "640x480", seed = "1",
              practice = "180";
  std::optional<std::string> object, organ, damage, friction, session, feedback, touch, tip, seal_friction,
      ghost, trainee, database, home;
  bool stress = false, test = false, seal = false, force = false, json = false;
};

trainer::ExclusionOptions options_of(const Request& request) {
  trainer::ExclusionOptions options;
  options.shows_stress = request.stress;
  options.feedback = trainer::feedback_of(request.feedback.value_or("full"));
  options.touch = trainer::touch_of(request.touch.value_or("fingertips"));
  if (options.touch != trainer::Touch::kTrocar && (request.tip || request.seal_friction))
    throw UsageError("--tip and --seal-friction are of instruments: add --touch trocar");
  if (options.touch == trainer::Touch::kTrocar && options.feedback == trainer::Feedback::kTangential)
    throw UsageError(
        "--feedback tangential is of fingers, and would play nothing of an instrument's lever: leave it out "
        "with --touch trocar");
  if (request.tip) options.instruments.tip = trainer::instrument_tip_of(*request.tip);
  if (request.seal_friction) {
    options.instruments.seal_friction_n =
        parse_number(*request.seal_friction, "--seal-friction", 0, trainer::kMostSealFrictionNewtons);
  }
  const std::vector<double> size = parse_numbers(request.size, 'x', 2, "--size");
  constexpr double kLeastSide = 64, kMostSide = 4096;
  for (const double side : size) {
    if (side < kLeastSide || side > kMostSide || side != 2 * std::floor(side / 2))
      throw UsageError("--size is '" + request.size +
                       "': sides are even numbers from 64 to 4096, as 640x480");
  }
  options.width = static_cast<int>(size[0]);
  options.height = static_cast<int>(size[1]);
  if (request.ghost)
    options.ghost = trainer::parse_hand_motion(sim::read_document(*request.ghost), *request.ghost);
  if (options.ghost && options.touch == trainer::Touch::kTrocar &&
      options.ghost->fingers > trainer::kMostExclusionFingers) {
    throw UsageError(*request.ghost + " moves " + std::to_string(options.ghost->fingers) +
                     " handles: the trainer has 1 to 5 instruments");
  }
  return options;
}

/// The columns of forces.csv for an instrument, and what stands in them.
std::string instrument_columns(std::size_t number) {
  const std::string of = ",instrument_" + std::to_string(number);
  std::string columns;
  for (const char* place : {"_depth_m", "_tilt_x_rad", "_tilt_y_rad", "_roll_rad"}) columns += of + place;
  for (const char* force : {"_tissue", "_handle", "_wall"}) {
    for (const char* axis : {"_x_n", "_y_n", "_z_n"}) columns += of + force + axis;
  }
  return columns + of + "_roll_nm";
}

std::string instrument_numbers(const trainer::HandForces::Instrument& instrument) {
  const trainer::InstrumentPlace& place = instrument.place;
  std::string numbers;
  for (const double number : {place.depth_m, place.tilt_x_rad, place.tilt_y_rad, place.roll_rad})
    numbers += "," + number_text(number);
  const trainer::InstrumentForces& forces = instrument.forces;
  for (const sim::Vector3& force_n : {forces.tissue_n, forces.handle_n, forces.wall_n}) {
    for (int axis = 0; axis < 3; ++axis) numbers += "," + number_text(force_n[axis]);
  }
  return numbers + "," + number_text(forces.handle_nm.dot(place.along()));
}

void letter(sim::Lettering& lettering, sim::Picture& picture, const trainer::ExclusionView& view,
            const trainer::ExclusionTask& task, bool shows_stress) {
  std::string below = "line " + number_text(std::round(100 * view.visible_share), 3) + " % in sight, force " +
                      number_text(view.hand.wrist_n.norm(), 2) + " N";
  if (shows_stress) {
    below += ", stress " + number_text(view.largest_von_mises_pa / 1e3, 3) + " kPa";
    sim::draw_stress_scale(lettering, picture, task.damage_pa);
  }
  sim::draw_caption(lettering, picture, number_text(std::round(10 * view.time_s) / 10) + " s", below);
}

/// Where the trainee stands; kiroku::UsageError where the curriculum does not allow the attempt.
trainer::TraineeProgress follow_curriculum(const trainer::TrainingDatabase& database,
                                           const trainer::Trainee& trainee, const std::string& object,
                                           std::optional<int> session, bool test, double practice_s) {
  const trainer::TraineeProgress progress = trainer::progress_of(database.attempts(), trainee.name, object);
  if (session && *session != progress.session) {
    throw UsageError("--session is " + std::to_string(*session) + ", and " + trainee.name +
                     " goes on with session " + std::to_string(progress.session) + " on object " + object +
                     ": leave it out");
  }
  if (const std::string why = trainer::not_allowed(progress, test, practice_s); !why.empty())
    throw UsageError(trainee.name + " " + why);
  return progress;
}

int run(const Request& request) {
  trainer::ExclusionOptions options = options_of(request);
  const std::size_t vertices =
      parse_count(request.vertices, "--vertices", trainer::kLeastObjectNodes, trainer::kMostObjectNodes);
  const std::size_t asked_fingers =
      parse_count(request.fingers, "--fingers", 1, trainer::kMostExclusionFingers);
  const auto seed = static_cast<std::uint32_t>(parse_count(request.seed, "--seed", 0, 4'000'000'000));
  const std::optional<UdpAddress> address = udp_address(request.hand);
  std::optional<trainer::HandMotion> played;
  const std::optional<PluginAddress> plugged = plugin_address(request.hand);
  if (!address && !plugged && request.hand != "simulated") {
    played = trainer::parse_hand_motion(sim::read_document(request.hand), request.hand);
    options.most_s = played->duration_s() + 1.5;
  }
  const std::size_t fingers = played ? played->fingers : asked_fingers;
  if (fingers > trainer::kMostExclusionFingers)
    throw UsageError(request.hand + " moves " + std::to_string(fingers) + " fingers: the trainer has 1 to 5");
  const TaskChoice choice =
      task_choice(request.damage, request.friction, parse_seconds(request.seconds, "--seconds", 1, 3600));
  std::optional<int> asked_session;
  if (request.session)
    asked_session = static_cast<int>(parse_count(*request.session, "--session", 1, 100'000));
  const double practice_s = parse_seconds(request.practice, "--practice", 0, 3600);
  if (request.trainee.has_value() != request.database.has_value())
    throw UsageError("--trainee and --database belong together: who, and where the attempt is kept");
  if (options.touch != trainer::Touch::kFingertips && request.trainee)
    throw UsageError("--touch " + *request.touch +
                     " is kept with no trainee, as learning curves are of fingertips: leave --trainee and "
                     "--database out");
  if (request.organ && request.object)
    throw UsageError("--organ and --object are two ways to say what is pushed aside: give one");
  if (request.test && request.stress) throw UsageError("--test is without stress: leave --stress out");
  if (request.test && !request.trainee)
    throw UsageError("--test belongs to a trainee: give --trainee and --database");
  std::unique_ptr<trainer::TrainingDatabase> database;
  std::optional<trainer::Trainee> trainee;
  if (request.trainee) {
    database = std::make_unique<trainer::TrainingDatabase>(*request.database);
    trainee = database->trainee(*request.trainee);
    if (trainee->simulated != (request.hand == "simulated")) {
      throw UsageError("'" + trainee->name + "' is " + (trainee->simulated ? "" : "not ") +
                       "a simulated trainee, and --hand is '" + request.hand +
                       "': results of people and of simulations are kept apart");
    }
  }
  if (request.home && !request.seal) throw UsageError("--home says where --seal makes a case: add --seal");
  std::optional<Home> home;
  if (request.seal) {
    home = Home::open(request.home);
    viewer::require_disk_room(home->archive(), 0, "free some, then begin again");
  }
  const UtcTime began = utc_now();
  std::vector<std::string> files{"score.json", "forces.csv", "hand.txt", kAttemptFilm};
  if (home) files.emplace_back(kAttemptVitals);
  const OutputFolder folder(request.output, files, request.force);

  StepLine line;
  const std::shared_ptr<const trainer::ExclusionBody> made =
      request.organ ? make_patient_body(*request.organ, choice)
                    : make_object_body(trainer::object_kind(request.object.value_or("a")), vertices, choice);
  const trainer::ExclusionBody& body = *made;
  const trainer::ExclusionTask& task = body.task();
  const double damage_pa = task.damage_pa;
  const std::string& object_name = body.object().name;
  std::unique_ptr<sim::PluginDevice> plugin;
  if (plugged) plugin = std::make_unique<sim::PluginDevice>(fingers, plugged->library, plugged->argument);
  if (request.organ && (address || plugged))
    trainer::require_haptic_rate(
        body, fingers, trainer::measured_force_rate_hz(body, fingers, options.touch, options.instruments));
  // Objects A and B are known to be lifted, with the usual friction.
  if ((request.organ || request.friction) && (address || plugged)) warn_of_doubt(body, std::array{fingers});
  int session = asked_session.value_or(1);
  if (trainee && !trainee->simulated) {
    const trainer::TraineeProgress progress =
        follow_curriculum(*database, *trainee, object_name, asked_session, request.test, practice_s);
    session = progress.session;
    const double left_s = practice_s - progress.practised_s;
    if (!request.test && practice_s > 0)
      options.most_s = options.most_s > 0 ? std::min(options.most_s, left_s) : left_s;
  }
  trainer::ExclusionRunner runner(body, options);
  media::FilmWriter film(folder.path(kAttemptFilm),
                         {options.width, options.height, 3, static_cast<int>(options.picture_rate_hz), 1},
                         request.force);
  sim::Lettering lettering;
  std::string csv =
      "time_s,visible_share,largest_von_mises_pa,damaged_ml,danger,tone_hz,wrist_x_n,wrist_y_n,wrist_z_n,"
      "wrist_x_nm,wrist_y_nm,wrist_z_nm";
  const bool whole_hand = options.touch == trainer::Touch::kHand,
             instruments = options.touch == trainer::Touch::kTrocar;
  for (std::size_t i = 1; i <= fingers; ++i)
    csv += instruments ? instrument_columns(i) : ",finger_" + std::to_string(i) + "_n";
  if (whole_hand) csv += ",phalanges_and_palm_n";
  csv += "\n";
  std::string vitals = kVitalsHead;
  std::unique_ptr<trainer::SimulatedTrainee> simulated;
  const auto observer = [&](const trainer::ExclusionView& view) {
    if (simulated) simulated->see(view, options.shows_stress);
    sim::Picture picture = *view.picture;
    letter(lettering, picture, view, task, options.shows_stress);
    film.add({picture.width, picture.height, 3, picture.rgb});
    csv += number_text(view.time_s, 9);
    for (const double number :
         {view.visible_share, view.largest_von_mises_pa, 1e6 * view.damaged_m3, view.danger, view.tone_hz,
          view.hand.wrist_n.x(), view.hand.wrist_n.y(), view.hand.wrist_n.z()})
      csv += "," + number_text(number);
    // Known of devices alone that say where the wrist is.
    for (int axis = 0; axis < 3; ++axis)
      csv += "," + (view.hand.wrist_torque_nm ? number_text((*view.hand.wrist_torque_nm)[axis]) : "");
    for (const trainer::HandForces::Instrument& instrument : view.hand.instruments)
      csv += instrument_numbers(instrument);
    if (!instruments) {
      for (const sim::Vector3& force_n : view.hand.forces_n) csv += "," + number_text(force_n.norm());
    }
    if (whole_hand) {
      const sim::Vector3 rest_n = std::accumulate(view.hand.parts_n.begin(), view.hand.parts_n.end(),
                                                  sim::Vector3(sim::Vector3::Zero()));
      csv += "," + number_text(rest_n.norm());
    }
    csv += "\n";
    vitals += vitals_lines(view);
    return !plugin || !plugin->lost();  // nobody moves the hand any more
  };
  trainer::ExclusionOutcome outcome;
  const double period_s = 1 / options.force_rate_hz;
  if (address) {
    sim::UdpDevice device(fingers, address->address, address->port);
    line.show("waiting for a hand, then for the line to be seen");
    outcome = runner.run_in_real_time(device, observer);
  } else if (plugin) {
    line.show("pushing");
    outcome = runner.run_in_real_time(*plugin, observer);
  } else {
    line.show("pushing");
    if (played) {
      trainer::MotionPlayer player(*played, period_s);
      outcome = runner.run_in_own_time(player, observer);
    } else {
      simulated = std::make_unique<trainer::SimulatedTrainee>(body, trainer::unpractised_plan(fingers, seed),
                                                              period_s);
      if (instruments) {
        trainer::HandlesOfTips handles(*simulated, trainer::trocars_of(task, fingers),
                                       trainer::InstrumentShape(options.instruments.tip));
        outcome = runner.run_in_own_time(handles, observer);
      } else {
        outcome = runner.run_in_own_time(*simulated, observer);
      }
    }
  }
  film.finish();
  if (trainee) {
    trainer::ExclusionRecord record;
    record.session = session;
    record.test = request.test;
    record.stress_shown = options.shows_stress;
    record.object = object_name;
    record.fingers = fingers;
    record.conditions = trainer::conditions_of(body);
    record.score = outcome.score;
    record.ending = outcome.score.done ? trainer::Ending::kDone : trainer::Ending::kTimeOver;
    database->add_attempt(*trainee, record, began);
  }
  folder.write("forces.csv", csv);
  folder.write("hand.txt", trainer::text_of(outcome.motion));
  Json report{{"object", object_name},
              {"hand", request.hand},
              {"simulated", request.hand == "simulated"},
              {"fingers", fingers},
              {"touch", request.touch.value_or("fingertips")},
              {"vertices", body.object().mesh.nodes.size()},
              {"tetrahedra", body.object().mesh.tetrahedra.size()},
              {"stress_shown", options.shows_stress},
              {"damage_pa", damage_pa},
              {"friction", task.friction},
              {"score", trainer::score_json(outcome.score)},
              {"pictures", outcome.pictures},
              {"elapsed_s", outcome.elapsed_s},
              {"faults", {{"unsound", outcome.faults.unsound}, {"jumps", outcome.faults.jumps}}}};
  if (instruments) {
    report["instruments"] = {{"tip", request.tip.value_or("retractor")},
                             {"seal_friction_n", options.instruments.seal_friction_n},
                             {"peak_wall_force_n", outcome.peak_wall_n}};
  }
  if (plugin && plugin->lost()) report["device_lost"] = plugin->why_lost();
  if (outcome.force_loop) {
    report["force_loop"] = {
        {"steps", outcome.force_loop->steps},
        {"on_time_share", outcome.force_loop->on_time_share()},
        {"step_median_us", static_cast<double>(outcome.force_loop->step_50.count()) / 1e3},
        {"without_pose", outcome.force_loop->without_pose}};
  }
  folder.write("score.json", report.dump(2) + "\n");
  std::optional<std::filesystem::path> sealed;
  if (home) {
    folder.write(kAttemptVitals, vitals);
    line.show("sealing");
    Json facts = report;
    facts["began"] = format_utc(began);
    if (trainee) {
      facts["trainee"] = trainee->name;
      facts["group"] = trainee->group;
      facts["session"] = session;
      facts["test"] = request.test;
    }
    sealed = seal_attempt(*home, request.output, kAttemptFilm, facts,
                          (trainee ? trainee->name + ": " : "") + in_words(outcome.score));
  }
  if (request.json) {
    report["folder"] = request.output;
    if (sealed) report["case"] = sealed->string();
    print_json(report);
    return outcome.score.done ? kDone : kAnswerIsNo;
  }
  const trainer::ExclusionScore& score = outcome.score;
  std::cout << printable(request.output) << ": " << in_words(score) << "\n  largest von Mises stress  "
            << number_text(score.largest_von_mises_pa / 1e3, 4) << " kPa; 99 % of the tissue stays below "
            << number_text(score.high_von_mises_pa.value_or(0) / 1e3, 4)
            << " kPa\n  tissue above the limit    " << number_text(1e6 * score.damaged_m3, 3) << " ml above "
            << number_text(damage_pa / 1e3, 4) << " kPa\n  path of all "
            << (instruments ? "tips          " : "fingers       ") << number_text(100 * score.path_m, 3)
            << " cm\n  largest force             " << number_text(score.peak_force_n, 3);
  if (instruments) {
    std::cout << " N of the tissue on an instrument, " << number_text(score.peak_wrist_n, 3)
              << " N at all handles, " << number_text(outcome.peak_wall_n, 3)
              << " N on the wall at a trocar\n";
  } else {
    std::cout << " N of a finger, " << number_text(score.peak_wrist_n, 3) << " N of all\n";
  }
  if (request.hand == "simulated") std::cout << "  a simulated trainee: no person did this\n";
  if (outcome.faults.unsound + outcome.faults.jumps > 0) {
    std::cout << "  the device failed: " << outcome.faults.unsound << " poses that are none, "
              << outcome.faults.jumps << " jumps; forces went to zero\n";
  }
  if (plugin && plugin->lost())
    std::cout << "  the plug-in " << plugin->why_lost() << ": the attempt ended there, forces went to zero\n";
  if (sealed) std::cout << "  sealed as " << sealed->string() << "\n";
  return score.done ? kDone : kAnswerIsNo;
}

}  // namespace

void add_train_exclusion_command(Command& train) {
  Command& command = train.add_command("exclusion", "push an organ aside until the line behind it is seen");
  const auto request = std::make_shared<Request>();
  command.required_option("--hand", "HAND", request->hand,
                          "a file of hand motion, udp:PORT or udp:ADDRESS:PORT, plugin:PATH[:ARGUMENT], or "
                          "'simulated'");
  command.required_option("-o,--output", "DIR", request->output, "where to");
  command.choice("--object", {"a", "b", "c"}, request->object,
                 "like a liver, like a lung with its bronchus and artery, or a great vein and an aorta", "a");
  command.option("--fingers", "N", request->fingers,
                 "of a device or a simulated trainee, or instruments, 1 to 5");
  command.option("--vertices", "N", request->vertices, "of the object's mesh");
  command.flag("--stress", request->stress, "shows stress in the tissue's colour");
  command.option("--organ", "FILE", request->organ,
                 "an organ of a CT instead (docs/explanation/training.md)");
  command.option("--damage", "PA", request->damage, "von Mises stress that counts as damage",
                 "100000, or what the organ's file says");
  command.option("--friction", "MU", request->friction,
                 "of a fingertip on the organ: the most force along its surface, in pressing ones; 0 glides",
                 "0.5, or what the organ's file says");
  command.choice("--feedback", {"full", "tangential"}, request->feedback,
                 "forces in three directions, or their part along each finger, which instruments do not have",
                 "full");
  command.choice("--touch", {"fingertips", "hand", "trocar"}, request->touch,
                 "with fingertips alone, with phalanges and palm, too, or with instruments that pivot in "
                 "trocars",
                 "fingertips");
  command.choice("--tip", {"retractor", "jaws"}, request->tip,
                 "of instruments: a blunt blade, or jaws that are closed", "retractor");
  command.option("--seal-friction", "N", request->seal_friction,
                 "what the seal of each trocar rubs on its instrument with, in newtons", "0");
  command.option("--ghost", "FILE", request->ghost,
                 "an expert's hand motion, shown beside the trainee's fingers");
  command.option("--seconds", "T", request->seconds, duration_help("until the attempt is over"));
  command.option("--size", "WxH", request->size, "of the pictures");
  command.option("--trainee", "NAME", request->trainee, "whose attempt it is ('kiroku train trainee')");
  command.option("--database", "FILE", request->database, "keeps the attempt there");
  command.writes("--database");
  command.option("--session", "N", request->session, "of the trainee's curriculum",
                 "the one that a person goes on with; 1");
  command.option("--practice", "T", request->practice,
                 duration_help("a person's practice in a session before its test; 0 asks for none"));
  command.flag("--test", request->test, "the session's test, without stress; else practice");
  command.option("--seed", "N", request->seed, "of the simulated trainee");
  command.flag("--seal", request->seal, "makes a case of it, signed and time-stamped, as of an operation");
  add_home_option(command, request->home);
  command.flag("-f,--force", request->force, "replaces what an earlier run left in DIR");
  command.flag("--json", request->json, "prints one JSON object instead");
  command.explain(
      "The object hides a line. It is pushed aside with fingertips until nine tenths of the line are in "
      "sight of the "
      "trainee's eye for a second. Writes DIR/film.mp4, score.json, forces.csv (for each picture) and "
      "hand.txt, the "
      "hand's motion, which --hand and --ghost take. The exit status is 1 where the line was not seen.");
  command.example("kiroku train exclusion --object a --hand simulated -o lift",
                  "a simulated trainee lifts object A");
  command.example("kiroku train exclusion --object c --hand simulated --stress -o vessels",
                  "the same of a great vein and an aorta");
  command.example("kiroku train exclusion --object b --hand udp:7001 --fingers 5 --stress -o own",
                  "a person at a device, stress shown");
  command.example("kiroku train exclusion --hand lift/hand.txt -o again", "the same motion again");
  command.example("kiroku train exclusion --hand lift/hand.txt --touch hand -o grasp",
                  "the same motion with a whole hand");
  command.example("kiroku train exclusion --touch trocar --fingers 2 --hand simulated -o laparoscopy",
                  "two instruments lift object A; a device's poses are those of their handles");
  command.example("kiroku train exclusion --organ liver.json --hand simulated -o liver", "a patient's liver");
  command.example(
      "kiroku train exclusion --hand udp:7001 --trainee Aoki --database training.sqlite --test --seal -o "
      "test",
      "a test that can be proven later: verify, view and report it as any case");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
