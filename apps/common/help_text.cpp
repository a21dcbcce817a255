#include <algorithm>
#include <sstream>

#include "apps/common/command_line.h"
#include "base/joined.h"

namespace kiroku::apps {
namespace {

constexpr std::size_t kWidth = 80;
constexpr std::size_t kColumn = 26;

/// Words of `text` in lines of at most kWidth, every line but the first indented.
std::string wrap(const std::string& text, std::size_t indent, std::size_t used) {
  std::istringstream words(text);
  std::string word, out;
  std::size_t column = used;
  bool first = true;
  while (words >> word) {
    if (!first && column + 1 + word.size() > kWidth) {
      out += "\n" + std::string(indent, ' ');
      column = indent;
    } else if (!first) {
      out += ' ';
      ++column;
    }
    out += word;
    column += word.size();
    first = false;
  }
  return out;
}

std::string row(const std::string& left, const std::string& right) {
  std::string line = "  " + left;
  if (line.size() + 2 > kColumn) {
    line += "\n" + std::string(kColumn, ' ');
  } else {
    line.resize(kColumn, ' ');
  }
  return line + wrap(right, kColumn, kColumn) + "\n";
}

std::string option_row(const OptionStatement& option) {
  std::string left = joined(option.names, ", ");
  if (!option.is_flag()) left += " " + option.value;
  std::string right = option.description;
  if (option.repeatable) right += " (may be repeated)";
  if (option.required) right += " (required)";
  if (!option.default_text.empty()) right += " (default: " + option.default_text + ")";
  return row(left, right);
}

/// `acts`: the command does something by itself, too.
std::string usage(const Command& command, bool acts) {
  std::string out = "Usage: " + command.full_name();
  if (!command.commands().empty() && !acts) return out + " COMMAND";
  for (const OptionStatement& option : command.options()) {
    if (option.required) out += " " + option.names.back() + " " + option.value;
  }
  out += " [OPTIONS]";
  for (const OptionStatement& argument : command.arguments()) {
    const std::string name = argument.names.front() + (argument.repeatable ? "..." : "");
    out += argument.required ? " " + name : " [" + name + "]";
  }
  if (!command.commands().empty()) out += "\n       " + command.full_name() + " COMMAND";
  return out;
}

}  // namespace

std::string Command::help() const {
  std::string out =
      wrap(full_name_ + " - " + purpose_, 0, 0) + "\n\n" + usage(*this, action_ != nullptr) + "\n";
  if (!commands_.empty()) {
    out += "\nCommands:\n";
    for (const auto& command : commands_) out += row(command->name(), command->purpose());
  }
  if (!arguments_.empty()) {
    out += "\nArguments:\n";
    for (const OptionStatement& argument : arguments_) {
      out += row(argument.names.front() + (argument.repeatable ? "..." : ""), argument.description);
    }
  }
  out += "\nOptions:\n";
  for (const OptionStatement& option : options_) out += option_row(option);
  for (const std::string& paragraph : paragraphs_) out += "\n" + wrap(paragraph, 0, 0) + "\n";
  if (!examples_.empty()) {
    out += examples_.size() == 1 ? "\nExample:\n" : "\nExamples:\n";
    for (const Example& example : examples_) {
      out += "  " + example.command_line + "\n      " + wrap(example.effect, 6, 6) + "\n";
    }
  }
  return out;
}

}  // namespace kiroku::apps
