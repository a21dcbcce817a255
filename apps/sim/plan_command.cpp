#include "apps/sim/plan_command.h"

#include <array>
#include <chrono>
#include <filesystem>
#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/common/progress.h"
#include "apps/sim/frame_series.h"
#include "apps/sim/number_option.h"
#include "apps/sim/plan_reading.h"
#include "base/error.h"
#include "base/number_text.h"
#include "sim/plan/plan_report.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

struct Request {
  std::string plan, output;
  std::optional<std::string> every;
  bool json = false, force = false;
};

int check(const Request& request) {
  const auto plan = read_plan_and_tell(request.plan, request.json);
  if (!plan) return kAnswerIsNo;
  // What only the body itself can tell: whether it is held, whether it can be solved for.
  const sim::ElasticBody body(plan->body.mesh, plan->body.materials, plan->body.constraints);
  if (request.json) {
    print_json({{"plan", request.plan},
                {"errors", nlohmann::json::array()},
                {"warnings", plan->body.warnings},
                {"nodes", plan->body.mesh.nodes.size()},
                {"tetrahedra", plan->body.mesh.tetrahedra.size()},
                {"unknowns", body.unknowns()},
                {"tools", plan->tools.size()},
                {"steps", plan->steps.size()},
                {"duration_s", duration_s(*plan)}});
  } else {
    std::cout << request.plan << ": nothing is wrong with it. " << plan->body.mesh.nodes.size() << " nodes, "
              << plan->tools.size() << " tools, " << plan->steps.size() << " steps, "
              << number_text(duration_s(*plan), 4)
              << " s. Whether every tool meets the tissue is seen when it runs.\n";
  }
  return kDone;
}

double interval_s(const Request& request) {
  constexpr double kLongestS = 3600;
  return request.every ? parse_number(*request.every, "--frames-every", 0, kLongestS) : 0;
}

void print_steps(const sim::Plan& plan, const sim::PlanRun& run) {
  const double units = sim::units_per_metre(plan.body.unit);
  const char* const unit = plan.body.unit == sim::LengthUnit::kMetre ? " m" : " mm";
  std::vector<std::vector<std::string>> rows{{"at", "step", "moved by", "von Mises", "forces"}};
  for (std::size_t i = 0; i < run.figures().size(); ++i) {
    const sim::StepFigures& figures = run.figures()[i];
    std::string forces;
    for (std::size_t tool = 0; tool < plan.tools.size(); ++tool) {
      if (figures.most_nodes[tool] == 0) continue;
      forces += (forces.empty() ? "" : ", ") + plan.tools[tool].tool.name + " " +
                number_text(figures.largest_force_n[tool], 3) + " N";
    }
    if (figures.tetrahedra_removed > 0) {
      forces +=
          (forces.empty() ? "" : ", ") + std::to_string(figures.tetrahedra_removed) + " tetrahedra cut out";
    }
    rows.push_back({number_text(figures.begins_s, 4) + " s", sim::name_of(plan.steps[i].action),
                    number_text(figures.largest_displacement_m * units, 3) + unit,
                    number_text(figures.largest_von_mises_pa, 3) + " Pa", printable(forces)});
  }
  std::cout << format_table(rows, "rlrrl", 2);
}

int run(const Request& request) {
  const double every_s = interval_s(request);
  const auto plan = read_plan_and_tell(request.plan, request.json);
  if (!plan) return kRefused;
  FrameSeries series(request.output, "plan", request.force,
                     {"forces.csv", "stress.csv", "tools.csv", "steps.json"});
  const auto begin = std::chrono::steady_clock::now();
  sim::PlanRun run(*plan);
  sim::PlanTables tables(*plan);
  const double all_s = duration_s(*plan);
  Progress progress("running the plan");
  const fs::path folder = request.output;
  std::string steps;
  const auto finish = [&](const std::optional<std::string>& stopped) {
    progress.clear();
    series.finish();
    write_text_file(folder / "forces.csv", tables.forces());
    write_text_file(folder / "stress.csv", tables.stress());
    write_text_file(folder / "tools.csv", tables.tools());
    steps = sim::steps_json(*plan, run, stopped);
    write_text_file(folder / "steps.json", steps);
  };
  double next_s = 0;
  const auto next = [&] {
    try {
      return run.next();
    } catch (const Error& stopped) {
      finish(stopped.what());
      throw Error(std::string(stopped.what()) + "; " + folder.string() + " holds what came before");
    }
  };
  while (next()) {
    tables.add(run);
    const sim::PlanFrame& frame = run.frame();
    // The end of each step is always kept.
    const bool last = !run.figures().empty() &&
                      frame.time_s >= run.figures().back().begins_s + plan->steps[frame.step].duration_s;
    if (frame.time_s >= next_s || last) {
      series.add(frame.time_s, sim::frame_vtu(*plan, run));
      next_s = frame.time_s + every_s;
    }
    constexpr double kMillisecondsPerSecond = 1000;
    progress.update(static_cast<std::uint64_t>(frame.time_s * kMillisecondsPerSecond),
                    static_cast<std::uint64_t>(all_s * kMillisecondsPerSecond));
  }
  finish({});
  if (request.json) {
    std::cout << steps;
    return kDone;
  }
  for (const sim::StepFigures& figures : run.figures()) {
    for (const std::string& remark : figures.remarks) print_error("kiroku", "warning: " + remark);
  }
  print_steps(*plan, run);
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  std::cout << printable(request.output) << ": " << series.count() << " frames of " << number_text(all_s, 4)
            << " s, computed in " << number_text(took.count(), 3) << " s\n  "
            << printable((folder / "plan.pvd").string())
            << "     for ParaView (Warp By Vector: displacement)\n  "
            << printable((folder / "forces.csv").string())
            << "   what each tool feels; stress.csv, tools.csv and steps.json beside it\n";
  return kDone;
}

}  // namespace

Command& add_plan_command(Command& program) {
  Command& plan = program.add_command("plan", "plans operations and carries them out");

  Command& checked = plan.add_command("check", "tells all that is wrong with a plan");
  const auto check_request = std::make_shared<Request>();
  checked.argument("PLAN", check_request->plan, "the plan (.json)");
  checked.flag("--json", check_request->json, "prints one JSON object instead");
  checked.explain(
      "Each error is told with its place in the document, such as steps[2].path[0].at_s. Exit status 0 if "
      "nothing is wrong, 1 if something is.");
  checked.example("kiroku plan check liver.json", "looks for mistakes");
  checked.on_run([check_request] { return check(*check_request); });

  Command& ran = plan.add_command("run", "computes a plan: deformation, forces, stress");
  const auto run_request = std::make_shared<Request>();
  ran.argument("PLAN", run_request->plan, "the plan (.json)");
  ran.required_option("-o,--output", "DIR", run_request->output, "where to; absent or empty");
  ran.option("--frames-every", "SECONDS", run_request->every,
             "writes fewer frames; the end of each step always", "every time step");
  ran.flag("-f,--force", run_request->force, "replaces what an earlier run left in DIR");
  ran.flag("--json", run_request->json, "prints the figures of the steps as one JSON object instead");
  ran.explain(
      "Writes DIR/plan.pvd with DIR/frames/*.vtu (ParaView: displacement, stress, von Mises stress), "
      "forces.csv (what each tool feels), stress.csv, tools.csv (where each tool is) and steps.json. The "
      "same "
      "plan gives the same bytes, whatever the number of processors.");
  ran.example("kiroku plan run liver.json -o liver", "carries the plan out");
  ran.example("kiroku plan run liver.json -o liver --frames-every 0.25", "with four frames a second");
  ran.on_run([run_request] { return run(*run_request); });
  add_plan_template_commands(plan);
  return plan;
}

}  // namespace kiroku::apps
