// The shape of a command line: commands, options, arguments, examples. A thin layer over CLI11 that keeps
// what it was told, so that help, completion scripts and error sentences all come from one statement. Objects
// are used by one thread.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "apps/common/output_place.h"

namespace CLI {  // NOLINT(readability-identifier-naming): the library's
class App;
class Option;
}  // namespace CLI

namespace kiroku::apps {

/// What every program returns.
enum ExitStatus : int {
  kDone = 0,
  kAnswerIsNo = 1,  // tampered, differs, refused
  kRefused = 2,     // wrong usage, unreadable input, could not be done
  kNoAnswer = 3,    // incomplete, unproven
  kOfAPart = 4,     // intact, but an excerpt of a case
};

/// The graver of two: a no outweighs a refusal, which outweighs no answer, and that an answer about a part
/// alone (docs/reference/format.md, "Verification").
int worse(int a, int b);

/// An option or argument as it was stated.
struct OptionStatement {
  std::vector<std::string> names;  // "-o", "--output"; one plain name for an argument
  std::string value;               // what stands for its value in help: "FILE"; empty for a flag
  std::string description;
  std::string default_text;  // empty: none
  std::vector<std::string> choices;
  bool repeatable = false;
  bool required = false;
  Writes writes = Writes::kNothing;  // each --output is one
  [[nodiscard]] bool is_flag() const { return value.empty(); }
};

/// One command, or the program itself. Variables given to it must live until the program has run.
class Command {
 public:
  Command(CLI::App& app, std::string full_name, std::string purpose);
  ~Command();
  Command(const Command&) = delete;
  Command& operator=(const Command&) = delete;

  /// A command that has arguments of its own, too, takes them where no command below it is named; they are
  /// stated before.
  Command& add_command(const std::string& name, const std::string& purpose);
  /// `names` as "-o,--output"; `value` as "FILE". A default is what the variable holds.
  void option(const std::string& names, const std::string& value, std::string& into,
              const std::string& description);
  void option(const std::string& names, const std::string& value, std::optional<std::string>& into,
              const std::string& description, const std::string& default_text = "");
  /// May be given several times, one value each.
  void option(const std::string& names, const std::string& value, std::vector<std::string>& into,
              const std::string& description);
  /// Takes two values: `values` as "FIXED MOVING". Empty, or of both.
  void pair_option(const std::string& names, const std::string& values, std::vector<std::string>& into,
                   const std::string& description);
  /// One of a few words.
  void choice(const std::string& names, const std::vector<std::string>& choices,
              std::optional<std::string>& into, const std::string& description,
              const std::string& default_text);
  void required_option(const std::string& names, const std::string& value, std::string& into,
                       const std::string& description);
  void flag(const std::string& names, bool& into, const std::string& description);
  void argument(const std::string& name, std::string& into, const std::string& description);
  void argument(const std::string& name, std::optional<std::string>& into, const std::string& description);
  void choice_argument(const std::string& name, const std::vector<std::string>& choices, std::string& into,
                       const std::string& description);
  /// At least one.
  void arguments(const std::string& name, std::vector<std::string>& into, const std::string& description);
  /// Of an option ("--stills") or argument that was stated: what it names is written to, so that it may not
  /// lie in a case or another place of a home's (output_place.h). Of --output that is so already.
  void writes(const std::string& name, Writes what = Writes::kOutput);
  /// A paragraph of help between options and examples.
  void explain(const std::string& paragraph);
  void example(const std::string& command_line, const std::string& effect);
  /// What the command does; returns the exit status.
  void on_run(std::function<int()> action);

  [[nodiscard]] const std::string& full_name() const { return full_name_; }  // "kiroku token verify"
  [[nodiscard]] const std::string& name() const { return name_; }            // "verify"
  [[nodiscard]] const std::string& purpose() const { return purpose_; }
  [[nodiscard]] const std::vector<OptionStatement>& options() const { return options_; }
  [[nodiscard]] const std::vector<OptionStatement>& arguments() const { return arguments_; }
  [[nodiscard]] const std::vector<std::unique_ptr<Command>>& commands() const { return commands_; }
  /// The page that --help prints.
  [[nodiscard]] std::string help() const;

 private:
  friend class Program;
  struct Example {
    std::string command_line, effect;
  };
  OptionStatement& state_option(const std::string& names, const std::string& value,
                                const std::string& description);
  OptionStatement& state_argument(const std::string& name, const std::string& description);
  /// Before anything is done: it may take hours until something is written.
  void require_output_places() const;

  CLI::App& app_;
  std::string full_name_, name_, purpose_;
  std::vector<OptionStatement> options_, arguments_;
  std::vector<std::string> paragraphs_;
  std::vector<Example> examples_;
  std::vector<std::unique_ptr<Command>> commands_;
  std::function<int()> action_;
};

/// A program: parses, runs the command that was named, and turns errors into one sentence on standard error
/// and an exit status.
class Program {
 public:
  /// `overview` is printed when the program is called without arguments.
  Program(const std::string& name, const std::string& purpose, std::string overview);
  ~Program();
  [[nodiscard]] Command& root() { return *root_; }
  int run(int argc, const char* const* argv);

 private:
  int run_parsed(int argc, const char* const* argv);
  std::string name_, overview_;
  std::unique_ptr<CLI::App> app_;
  std::unique_ptr<Command> root_;
};

/// Of all programs of Kiroku: "0.1.0".
std::string_view version();

/// "<program>: <sentence>" on standard error, line breaks and control characters in it made visible.
void print_error(std::string_view program, std::string_view sentence);
/// Text that came from a file or a network, fit for a terminal (base/printable.h).
std::string printable(std::string_view text);

}  // namespace kiroku::apps
