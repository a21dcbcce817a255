// 'kiroku boot': the states of the measured boot in which a sealed key of a TPM signs.
#include <algorithm>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <unistd.h>
#include <vector>

#include <nlohmann/json.hpp>

#include "apps/common/file.h"
#include "apps/common/json_output.h"
#include "apps/common/terminal.h"
#include "apps/kiroku/approval_key_file.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/output_file.h"
#include "archive/format/boot_quote.h"
#include "base/error.h"
#include "crypto/encoding.h"
#include "recorder/device_key/boot_approval.h"
#include "recorder/device_key/hardware_description.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr unsigned kForAll = 0666;

struct Request {
  std::string file, key, output, pcrs = crypto::pcr_list(recorder::kUsualSealedPcrs);
  std::optional<std::string> home, state_output, values_of, against;
  bool no_passphrase = false, yes = false, json = false;
};

void write_output(const fs::path& file, std::string_view text) {
  OutputFile out(file, kForAll);
  out.write(bytes_of(text));
  out.commit(OutputFile::Durability::kNow);
}

template <typename Read>
Read read_as(const std::string& file, const std::string& what) {
  const Bytes text = read_small_file(file, what);
  try {
    return Read::parse(text_of(text));
  } catch (const Error& error) {
    throw Error("cannot use " + file + ": " + error.what());
  }
}

/// The description of a key that is sealed; kiroku::UsageError for a home without.
recorder::HardwareDescription sealed_hardware(const Home& home) {
  std::error_code ignored;
  if (!fs::exists(home.hardware_file(), ignored))
    throw UsageError("the home " + home.folder().string() + " has no key in hardware that could be sealed");
  recorder::HardwareDescription hardware = home.hardware();
  if (!hardware.seal) {
    throw UsageError("the key in hardware of " + home.folder().string() +
                     " is not sealed: it signs in every state of the boot (kiroku init --seal-to-boot)");
  }
  return hardware;
}

int new_key(const Request& request) {
  if (fs::exists(request.file)) {
    throw UsageError(request.file + " is there already and is not overwritten: name another file");
  }
  std::optional<crypto::Secret> passphrase;
  if (!request.no_passphrase) passphrase = ask_new_passphrase("the approval key " + request.file);
  const auto key = crypto::ApprovalKey::generate();
  save_approval_key(request.file, key.to_pem(passphrase ? &*passphrase : nullptr));
  std::cout << "The approval key is in " << printable(request.file)
            << ".\nKeep it away from every recorder, and a copy elsewhere: whoever has it approves what a "
               "recorder may start, and a device whose key is lost cannot be approved again.\n"
            << "Next: kiroku init --add-tpm --seal-to-boot " << printable(request.file) << "\n";
  return kDone;
}

/// One line a register; `before` has the values to compare with, or nothing.
void print_registers(const std::vector<crypto::PcrValue>& pcrs,
                     const std::optional<std::vector<unsigned>>& differing, const std::string& same) {
  for (const crypto::PcrValue& each : pcrs) {
    std::cout << "  " << archive::pcr_name(each.index) << ": " << crypto::to_hex(each.value);
    if (differing) {
      const bool differs = std::find(differing->begin(), differing->end(), each.index) != differing->end();
      std::cout << "  " << (differs ? paint(Colour::kYellow, "DIFFERS") : same);
    }
    std::cout << "\n";
  }
}

ordered_json registers_json(const std::vector<crypto::PcrValue>& pcrs) {
  ordered_json out = ordered_json::object();
  for (const crypto::PcrValue& each : pcrs) out[std::to_string(each.index)] = crypto::to_hex(each.value);
  return out;
}

int state(const Request& request) {
  const Home home = Home::open(request.home);
  const recorder::HardwareDescription hardware = sealed_hardware(home);
  const recorder::BootState now{home.device().name(), *hardware.seal,
                                recorder::read_registers(hardware.address, hardware.seal->pcrs)};
  const auto approvals = recorder::read_approvals(home.boot_approvals_folder(), *hardware.seal);
  const auto differing = recorder::differing_registers(now.pcrs, approvals.counting);
  const bool approved = differing && differing->empty();
  if (request.state_output) write_output(*request.state_output, now.to_json());
  if (request.json) {
    print_json({{"device", now.device},
                {"seal", crypto::seal_name(now.seal)},
                {"approved", approved},
                {"registers", registers_json(now.pcrs)},
                {"differing", differing ? ordered_json(*differing) : ordered_json(nullptr)},
                {"approved_states", approvals.counting.size()},
                {"problems", approvals.problems}});
    return approved ? kDone : kAnswerIsNo;
  }
  std::cout << "This machine started in a state that is "
            << (approved ? paint(Colour::kGreen, "approved") : paint(Colour::kRed, "NOT approved")) << "; "
            << approvals.counting.size() << " state(s) are. The seal of its key is "
            << crypto::seal_name(now.seal) << ".\n";
  print_registers(now.pcrs, differing, "as approved");
  for (const std::string& problem : approvals.problems)
    std::cout << paint(Colour::kYellow, "  " + printable(problem)) << "\n";
  if (request.state_output) std::cout << "The state is in " << printable(*request.state_output) << ".\n";
  if (!approved) {
    std::cout << "Recording goes on; what is recorded is unproven until the state is approved.\n"
                 "1. Compare what differs with the updates of these days. What nobody can explain is not "
                 "approved.\n"
                 "2. Take the state to whoever has the approval key: kiroku boot state -o state.json\n"
                 "3. There, on another computer: kiroku boot approve state.json --key KEY -o now.approval\n"
                 "4. Here: kiroku boot accept now.approval\n";
  }
  return approved ? kDone : kAnswerIsNo;
}

/// A recorder's own word must not choose what is looked at: the TPM takes an approval of any registers.
void require_expected(const recorder::BootState& state, const Request& request) {
  std::string problem;
  const auto expected = crypto::parse_pcr_list(request.pcrs, problem);
  if (!expected) throw UsageError("--pcrs " + request.pcrs + ": " + problem);
  if (state.seal.pcrs == *expected) return;
  throw UsageError(
      request.file + " is of the registers " + crypto::pcr_list(state.seal.pcrs) + ", and not of " +
      crypto::pcr_list(*expected) +
      ": give --pcrs if that is what was chosen when the recorder was set up, and approve nothing "
      "otherwise");
}

/// The output must not take the place of what it is made from; the approval key above all.
void require_output_apart(const Request& request) {
  std::vector<std::string> inputs{request.key, request.file};
  for (const auto& each : {request.against, request.values_of}) {
    if (each) inputs.push_back(*each);
  }
  for (const std::string& input : inputs) {
    std::error_code absent;
    if (fs::equivalent(request.output, input, absent))
      throw UsageError("-o " + request.output + " is the file " + input + " that is read: name another file");
  }
}

/// kiroku::UsageError unless somebody who saw what differs wants it approved all the same.
void require_yes(const Request& request) {
  if (request.yes) return;
  if (request.json || !output_is_terminal() || ::isatty(STDIN_FILENO) != 1) {
    throw UsageError(request.file + " differs from " + *request.against +
                     ", and nothing was approved: look at what differs, and give --yes to approve it");
  }
  std::cout << "Registers differ from " << printable(*request.against) << ". Approve? [yes/no] "
            << std::flush;
  std::string answer;
  std::getline(std::cin, answer);
  if (answer != "yes") throw UsageError("the answer was not 'yes': nothing was approved");
}

int approve(const Request& request) {
  require_output_apart(request);
  auto state = read_as<recorder::BootState>(request.file, "the state of a boot");
  require_expected(state, request);
  std::optional<std::vector<unsigned>> differing;
  std::string same;
  if (request.values_of) {
    const auto twin = read_as<recorder::BootState>(*request.values_of, "the state of a boot");
    if (twin.seal.pcrs != state.seal.pcrs) {
      throw UsageError(*request.values_of + " is of the registers " + crypto::pcr_list(twin.seal.pcrs) +
                       ", and " + request.file + " of " + crypto::pcr_list(state.seal.pcrs) +
                       ": the two devices are sealed otherwise");
    }
    recorder::BootApproval own;
    own.pcrs = state.pcrs;
    differing = recorder::differing_registers(twin.pcrs, {own});
    same = "as in the recorder's own state";
    state.pcrs = twin.pcrs;
  }
  if (request.against) {
    same = "as before";
    const auto before = read_as<recorder::BootApproval>(*request.against, "an approval");
    if (const std::string why = recorder::why_no_approval(before, state.seal); !why.empty())
      throw UsageError("cannot compare with " + *request.against + ": " + why);
    differing = recorder::differing_registers(state.pcrs, {before});
  }
  if (!request.json) {
    std::cout << "To be approved for the device " << printable(state.device) << " with the seal "
              << crypto::seal_name(state.seal) << ", for good:\n";
    print_registers(state.pcrs, differing, same);
    std::cout << std::flush;
  }
  if (request.against && differing && !differing->empty()) require_yes(request);
  const auto approval = recorder::approve(state, load_approval_key(request.key));
  write_output(request.output, approval.to_json());
  if (request.json) {
    print_json({{"device", state.device},
                {"seal", crypto::seal_name(state.seal)},
                {"approval", request.output},
                {"registers", registers_json(state.pcrs)},
                {"differing", differing ? ordered_json(*differing) : ordered_json(nullptr)}});
    return kDone;
  }
  std::cout << "Approved. Next, on that recorder: kiroku boot accept " << printable(request.output) << "\n";
  return kDone;
}

int accept(const Request& request) {
  const Home home = Home::open(request.home);
  const recorder::HardwareDescription hardware = sealed_hardware(home);
  const auto approval = read_as<recorder::BootApproval>(request.file, "an approval");
  if (const std::string why = recorder::why_no_approval(approval, *hardware.seal); !why.empty())
    throw UsageError(request.file + " does not count here: " + why);
  const fs::path kept = keep_approval(home.boot_approvals_folder(), approval);
  const std::string silent = crypto::why_silent(*home.hardware_signer());
  if (request.json) {
    print_json({{"approval", kept.string()}, {"signs", silent.empty()}, {"why_not", silent}});
    return kDone;
  }
  std::cout << "The state is approved: " << printable(kept.string()) << "\n";
  if (silent.empty()) {
    std::cout
        << "The TPM signs in the state that this machine is in. A recorder that runs signs with it again by "
           "itself, with its next checkpoint.\n";
  } else {
    std::cout << "The TPM does not sign now, which is right where the state is yet to come: "
              << printable(silent) << "\n";
  }
  return kDone;
}

}  // namespace

void add_boot_command(Command& program) {
  Command& group =
      program.add_command("boot", "approves what this machine may start, for a TPM key that is sealed to it");
  group.explain(
      "A key that 'kiroku init --seal-to-boot' made signs only where firmware, boot loader and kernel are as "
      "somebody approved. After an update the recorder goes on recording, and what it records is unproven "
      "until "
      "the new state is approved: 'state' writes it to a file here, 'approve' signs it where the approval "
      "key is, "
      "'accept' takes the approval in here. An approved state stays approved "
      "(docs/how-to/keep-a-key-in-hardware.md).");

  Command& making =
      group.add_command("new-key", "makes an approval key, on another computer than a recorder");
  const auto made = std::make_shared<Request>();
  making.argument("FILE", made->file, "where it goes: PKCS#8, P-256, mode 0600");
  making.writes("FILE");
  making.flag("--no-passphrase", made->no_passphrase, "it lies open in its file");
  making.explain("The passphrase is asked on the terminal or taken from KIROKU_PASSPHRASE.");
  making.example("kiroku boot new-key /media/stick/approval.pem",
                 "a key on a stick that is kept locked away");
  making.on_run([made] { return new_key(*made); });

  Command& telling =
      group.add_command("state", "tells whether the state that this machine started in is approved");
  const auto told = std::make_shared<Request>();
  telling.option("-o,--output", "FILE", told->state_output,
                 "writes the state there, for 'kiroku boot approve'");
  add_home_option(telling, told->home);
  telling.flag("--json", told->json, "prints one JSON object instead");
  telling.explain(
      "Exit status 0 where it is approved, 1 where it is not, 2 where that could not be checked, or the key "
      "is "
      "not sealed.");
  telling.example("kiroku boot state -o state.json", "after an update, for whoever has the approval key");
  telling.on_run([told] { return state(*told); });

  Command& approving =
      group.add_command("approve", "signs a state, on the computer where the approval key is");
  const auto approved = std::make_shared<Request>();
  approving.argument("STATE", approved->file, "what 'kiroku boot state -o' wrote on the recorder");
  approving.required_option("--key", "KEY", approved->key, "the approval key");
  approving.required_option("-o,--output", "APPROVAL", approved->output, "where the approval goes");
  approving.option(
      "--pcrs", "LIST", approved->pcrs,
      "the registers that were chosen when the recorder was set up: of others nothing is approved");
  approving.option(
      "--values-of", "STATE", approved->values_of,
      "approves the values of this state instead: that of another recorder of the same make, which "
      "has the update already");
  approving.option("--against", "APPROVAL", approved->against,
                   "tells which registers differ from this approval, and asks before such a state is signed");
  approving.flag("--yes", approved->yes, "approves what differs from --against without being asked");
  approving.flag("--json", approved->json, "prints one JSON object instead");
  approving.explain(
      "Needs no home. Prints the device, its seal and the registers before it signs. Whoever signs answers "
      "for the state: a state file says what the recorder says of itself, "
      "and the values alone do not tell whether that is sound. The passphrase is asked on the terminal or "
      "taken "
      "from KIROKU_PASSPHRASE.");
  approving.example("kiroku boot approve state.json --key approval.pem -o now.approval",
                    "approves what the recorder started");
  approving.example("kiroku boot approve or-3.json --values-of or-4.json --key approval.pem -o next.approval",
                    "approves ahead of an update what it made of a recorder of the same make");
  approving.on_run([approved] { return approve(*approved); });

  Command& accepting = group.add_command("accept", "takes an approval in, on the recorder");
  const auto accepted = std::make_shared<Request>();
  accepting.argument("APPROVAL", accepted->file, "what 'kiroku boot approve' wrote");
  add_home_option(accepting, accepted->home);
  accepting.flag("--json", accepted->json, "prints one JSON object instead");
  accepting.explain(
      "One that is not by the approval key, for another device or of other registers is refused. The "
      "recorder "
      "need not be started anew.");
  accepting.example("kiroku boot accept now.approval", "the TPM signs again");
  accepting.on_run([accepted] { return accept(*accepted); });
}

}  // namespace kiroku::apps
