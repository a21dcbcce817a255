// kiroku-full: every command of kiroku, with all the libraries they need. People start it through kiroku.

#include "apps/kiroku/commands.h"
#include "apps/kiroku/user_command.h"
#include "apps/kiroku/view_command.h"
#include "apps/sim/plan_command.h"
#include "apps/sim/sim_command.h"
#include "apps/train/train_command.h"
#include "recorder/source/source_guard.h"

namespace {

constexpr const char* kOverview =
    R"(kiroku records operations so that a recording can be proved whole, and when it was made.

  kiroku init --demo                                   a home to try things out
  kiroku record --endoscope synthetic:endoscope --room synthetic:room \
      --vitals synthetic:patient --duration 20s        a recording without any camera
  kiroku cases                                         what is recorded
  kiroku verify CASE                                   is it whole, and when did it exist?
  kiroku report CASE -o report.pdf                     the same, for a court to read
  kiroku export CASE --stream endoscope -o film.ts     the pictures, for a recipient

Other commands: case, status, doctor, recover, excerpt, erase, seal, unseal, stamp, token, tsa, log, view, user, sim, plan, compare, train, completion.
'kiroku --help' lists them all, 'kiroku COMMAND --help' explains one.
)";

}  // namespace

int main(int argc, char** argv) {
  using namespace kiroku::apps;
  Program program("kiroku", "records operations, sealed and time-stamped, and proves it", kOverview);
  Command& root = program.root();
  add_init_command(root);
  add_record_command(root);
  add_case_command(root);
  add_status_command(root);
  add_doctor_command(root);
  add_recover_command(root);
  add_cases_command(root);
  add_verify_command(root);
  add_report_command(root);
  add_export_command(root);
  add_excerpt_command(root);
  add_erase_command(root);
  add_seal_command(root);
  add_unseal_command(root);
  add_stamp_command(root);
  add_token_command(root);
  add_tsa_command(root);
  add_log_command(root);
  add_view_command(root);
  add_user_command(root);
  Command& sim = add_sim_command(root);
  add_sim_render_command(sim);
  add_sim_transfer_command(sim);
  add_sim_drr_film_command(sim);
  Command& plan = add_plan_command(root);
  add_plan_replay_command(plan);
  add_plan_seal_commands(plan);
  add_plan_pick_command(plan);
  add_plan_serve_command(plan);
  add_compare_command(root);
  add_train_command(root);
  add_completion_command(root);
  return kiroku::recorder::end_process(program.run(argc, argv));
}
