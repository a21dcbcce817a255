#include "apps/common/command_line.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <iostream>
#include <new>
#include <span>

#include <CLI/CLI.hpp>

#include "apps/common/version.h"
#include "base/error.h"
#include "base/near_miss.h"
#include "base/printable.h"

namespace kiroku::apps {
namespace {

std::vector<std::string> split_names(const std::string& names) {
  std::vector<std::string> parts;
  std::istringstream in(names);
  for (std::string part; std::getline(in, part, ',');) parts.push_back(part);
  return parts;
}

/// CLI11's own pages are not used: help comes from what the command was told.
class StatedHelp : public CLI::FormatterBase {
 public:
  explicit StatedHelp(const Command& command) : command_(command) {}
  std::string make_help(const CLI::App* /*app*/, std::string /*name*/,
                        CLI::AppFormatMode /*mode*/) const override {
    return command_.help();
  }

 private:
  const Command& command_;
};

std::string alternatives(const std::vector<std::string>& choices) {
  std::string out;
  for (const std::string& choice : choices) out += (out.empty() ? "" : "|") + choice;
  return out;
}

/// The words of an ExtrasError: the list after its colon.
std::vector<std::string> unexpected_words(const std::string& text) {
  std::istringstream in(text.substr(text.find(": ") + 2));
  std::vector<std::string> words;
  for (std::string word; in >> word;) words.push_back(word);
  return words;
}

std::vector<std::string> command_names(const Command& command) {
  std::vector<std::string> names;
  for (const auto& child : command.commands()) names.push_back(child->name());
  return names;
}

/// Long ones: one letter is as near to every other.
std::vector<std::string> option_names(const Command& command) {
  std::vector<std::string> names;
  for (const OptionStatement& option : command.options()) {
    for (const std::string& name : option.names) {
      if (name.starts_with("--")) names.push_back(name);
    }
  }
  return names;
}

/// Of a word that is none of an option's choices, which CLI11 tells as "--profile: h264 not in {…}".
std::string choice_meant(const std::string& text, const Command& command) {
  const std::size_t colon = text.find(": "), rest = text.find(" not in {");
  if (colon == std::string::npos || rest == std::string::npos || rest < colon + 2) return "";
  const std::string name = text.substr(0, colon), typed = text.substr(colon + 2, rest - colon - 2);
  for (const auto* const statements : {&command.options(), &command.arguments()}) {
    for (const OptionStatement& statement : *statements) {
      if (std::find(statement.names.begin(), statement.names.end(), name) != statement.names.end()) {
        return did_you_mean(typed, statement.choices);
      }
    }
  }
  return "";
}

std::string no_such_option(const std::string& word, const Command& command) {
  const std::string name = word.substr(0, word.find('='));
  return "there is no option '" + name + "' here" + did_you_mean(name, option_names(command));
}

/// One sentence, beginning in lower case, for what CLI11 refused.
std::string parse_sentence(const CLI::ParseError& error, const Command& command,
                           std::span<const char* const> typed) {
  std::string text = error.what();
  if (dynamic_cast<const CLI::ExtrasError*>(&error) != nullptr) {
    // An unknown option makes its value unexpected, too: the option is what was wrong.
    const std::vector<std::string> words = unexpected_words(text);
    for (const std::string& word : words) {
      if (word.size() > 1 && word[0] == '-') return no_such_option(word, command);
    }
    // CLI11 tells them in an order of its own: what follows a mistyped command is its arguments.
    const auto first =
        std::find_first_of(typed.begin(), typed.end(), words.begin(), words.end(),
                           [](const char* one, const std::string& other) { return other == one; });
    const std::string word = first != typed.end() ? *first : words.empty() ? "" : words.front();
    return "'" + word + "' is neither a command of " + command.full_name() +
           " nor expected as an argument here" + did_you_mean(word, command_names(command));
  }
  if (dynamic_cast<const CLI::RequiredError*>(&error) != nullptr) {
    // What lacks may be there, mistyped: CLI11 looks for it first.
    const std::vector<std::string> known = option_names(command);
    for (const std::string word : typed) {
      if (word == "--") break;
      if (!word.starts_with("--") || word == "--help") continue;
      const std::string name = word.substr(0, word.find('='));
      if (std::find(known.begin(), known.end(), name) == known.end() && nearest_word(name, known)) {
        return no_such_option(word, command);
      }
    }
  }
  if (const std::size_t many = text.find(": At Most 1 required but received"); many != std::string::npos) {
    return text.substr(0, many) + " may be given only once";
  }
  const std::string meant = choice_meant(text, command);
  const auto is_upper = [](char c) { return c >= 'A' && c <= 'Z'; };
  if (text.size() > 1 && is_upper(text[0]) && !is_upper(text[1])) text[0] = char(text[0] - 'A' + 'a');
  while (!text.empty() && (text.back() == '\n' || text.back() == '.' || text.back() == ' ')) text.pop_back();
  return text + meant;
}

}  // namespace

int worse(int a, int b) {
  constexpr std::array kGravestFirst{kAnswerIsNo, kRefused, kNoAnswer, kOfAPart, kDone};
  return std::find(kGravestFirst.begin(), kGravestFirst.end(), a) <
                 std::find(kGravestFirst.begin(), kGravestFirst.end(), b)
             ? a
             : b;
}

std::string printable(std::string_view text) { return kiroku::printable(text); }

std::string_view version() { return kVersion; }

void print_error(std::string_view program, std::string_view sentence) {
  std::cerr << program << ": " << printable(sentence) << std::endl;
}

Command::Command(CLI::App& app, std::string full_name, std::string purpose)
    : app_(app),
      full_name_(std::move(full_name)),
      name_(full_name_.substr(full_name_.rfind(' ') == std::string::npos ? 0 : full_name_.rfind(' ') + 1)),
      purpose_(std::move(purpose)) {
  app_.formatter(std::make_shared<StatedHelp>(*this));
  app_.set_help_flag("-h,--help", "prints this page");
  state_option("-h,--help", "", "prints this page");
}

Command::~Command() = default;

Command& Command::add_command(const std::string& name, const std::string& purpose) {
  // What a command takes by itself is not asked for where one below it is named; Program looks after it.
  for (const OptionStatement& argument : arguments_) app_.get_option(argument.names.front())->required(false);
  CLI::App* app = app_.add_subcommand(name, purpose);
  commands_.push_back(std::make_unique<Command>(*app, full_name_ + " " + name, purpose));
  return *commands_.back();
}

OptionStatement& Command::state_option(const std::string& names, const std::string& value,
                                       const std::string& description) {
  OptionStatement statement;
  statement.names = split_names(names);
  statement.value = value;
  statement.description = description;
  if (std::ranges::find(statement.names, "--output") != statement.names.end())
    statement.writes = Writes::kOutput;
  // --help stays last on the page.
  const auto at = options_.empty() ? options_.end() : options_.end() - 1;
  return *options_.insert(at, statement);
}

OptionStatement& Command::state_argument(const std::string& name, const std::string& description) {
  OptionStatement statement;
  statement.names = {name};
  statement.value = name;
  statement.description = description;
  arguments_.push_back(statement);
  return arguments_.back();
}

void Command::option(const std::string& names, const std::string& value, std::string& into,
                     const std::string& description) {
  app_.add_option(names, into, description);
  state_option(names, value, description).default_text = into;
}

void Command::option(const std::string& names, const std::string& value, std::optional<std::string>& into,
                     const std::string& description, const std::string& default_text) {
  app_.add_option_function<std::string>(
      names, [&into](const std::string& text) { into = text; }, description);
  state_option(names, value, description).default_text = default_text;
}

void Command::option(const std::string& names, const std::string& value, std::vector<std::string>& into,
                     const std::string& description) {
  app_.add_option(names, into, description)->allow_extra_args(false);
  state_option(names, value, description).repeatable = true;
}

void Command::pair_option(const std::string& names, const std::string& values, std::vector<std::string>& into,
                          const std::string& description) {
  app_.add_option(names, into, description)->expected(2);
  state_option(names, values, description);
}

void Command::choice(const std::string& names, const std::vector<std::string>& choices,
                     std::optional<std::string>& into, const std::string& description,
                     const std::string& default_text) {
  app_.add_option_function<std::string>(
          names, [&into](const std::string& text) { into = text; }, description)
      ->check(CLI::IsMember(choices));
  OptionStatement& statement = state_option(names, alternatives(choices), description);
  statement.choices = choices;
  statement.default_text = default_text;
}

void Command::required_option(const std::string& names, const std::string& value, std::string& into,
                              const std::string& description) {
  app_.add_option(names, into, description)->required();
  state_option(names, value, description).required = true;
}

void Command::flag(const std::string& names, bool& into, const std::string& description) {
  app_.add_flag(names, into, description);
  state_option(names, "", description);
}

void Command::argument(const std::string& name, std::string& into, const std::string& description) {
  app_.add_option(name, into, description)->required();
  state_argument(name, description).required = true;
}

void Command::argument(const std::string& name, std::optional<std::string>& into,
                       const std::string& description) {
  app_.add_option_function<std::string>(
      name, [&into](const std::string& text) { into = text; }, description);
  state_argument(name, description);
}

void Command::choice_argument(const std::string& name, const std::vector<std::string>& choices,
                              std::string& into, const std::string& description) {
  app_.add_option(name, into, description)->required()->check(CLI::IsMember(choices));
  OptionStatement& statement = state_argument(name, description);
  statement.required = true;
  statement.choices = choices;
}

void Command::arguments(const std::string& name, std::vector<std::string>& into,
                        const std::string& description) {
  app_.add_option(name, into, description)->required();
  OptionStatement& statement = state_argument(name, description);
  statement.required = true;
  statement.repeatable = true;
}

void Command::writes(const std::string& name, Writes what) {
  for (auto* const statements : {&options_, &arguments_}) {
    for (OptionStatement& statement : *statements) {
      if (std::ranges::find(statement.names, name) != statement.names.end()) statement.writes = what;
    }
  }
}

void Command::require_output_places() const {
  for (const auto* const statements : {&options_, &arguments_}) {
    for (const OptionStatement& statement : *statements) {
      if (statement.writes == Writes::kNothing) continue;
      const std::string& name = statement.names.back();
      for (const std::string& named : app_.get_option(name)->results())
        require_output_place(named, name, statement.writes);
    }
  }
}

void Command::explain(const std::string& paragraph) { paragraphs_.push_back(paragraph); }

void Command::example(const std::string& command_line, const std::string& effect) {
  examples_.push_back({command_line, effect});
}

void Command::on_run(std::function<int()> action) { action_ = std::move(action); }

Program::Program(const std::string& name, const std::string& purpose, std::string overview)
    : name_(name), overview_(std::move(overview)), app_(std::make_unique<CLI::App>(purpose, name)) {
  root_ = std::make_unique<Command>(*app_, name, purpose);
  app_->set_version_flag("--version", name + " " + kVersion);
  root_->state_option("--version", "", "prints the version");
}

Program::~Program() = default;

int Program::run_parsed(int argc, const char* const* argv) {
  const Command* command = root_.get();
  const auto descend = [&] {
    for (bool found = true; found;) {
      found = false;
      for (const auto& child : command->commands_) {
        if (!child->app_.parsed()) continue;
        command = child.get();
        found = true;
        break;
      }
    }
  };
  try {
    app_->parse(argc, argv);
    descend();
  } catch (const CLI::Success& wish) {
    descend();
    if (dynamic_cast<const CLI::CallForVersion*>(&wish) != nullptr) {
      std::cout << wish.what() << "\n";
    } else {
      std::cout << command->help();
    }
    return kDone;
  } catch (const CLI::ParseError& error) {
    descend();
    throw UsageError(parse_sentence(error, *command, {argv, std::size_t(argc)}) + "; see '" +
                     command->full_name() + " --help'");
  }
  if (command->action_) {
    for (const OptionStatement& argument : command->arguments_) {
      const std::string& name = argument.names.front();
      if (argument.required && command->app_.get_option(name)->empty()) {
        throw UsageError(name + " is required; see '" + command->full_name() + " --help'");
      }
    }
    command->require_output_places();
    return command->action_();
  }
  if (command == root_.get()) {
    std::cout << overview_;
    return kDone;
  }
  std::string names;
  for (const auto& child : command->commands_) names += (names.empty() ? "" : ", ") + child->name();
  throw UsageError("'" + command->full_name() + "' needs a command after it (" + names + "); see '" +
                   command->full_name() + " --help'");
}

int Program::run(int argc, const char* const* argv) {
  try {
    const int status = run_parsed(argc, argv);
    std::cout.flush();
    if (!std::cout) throw Error("cannot write all of the answer to standard output: is its disk full?");
    return status;
  } catch (const Error& error) {
    print_error(name_, error.what());
  } catch (const std::filesystem::filesystem_error& error) {
    print_error(name_, IoError("reach", error.path1(), error.code().value()).what());
  } catch (const std::bad_alloc&) {
    print_error(name_, "there is not enough memory for this: close other programs and try again");
  } catch (const std::exception& error) {
    print_error(name_, std::string("stopped by an unforeseen error: ") + error.what());
  }
  return kRefused;
}

}  // namespace kiroku::apps
