#include "apps/kiroku/completion.h"

#include <algorithm>
#include <functional>
#include <vector>

namespace kiroku::apps {
namespace {

enum class Offers { kNothing, kFiles, kFolders, kCases, kWords };

Offers offers_of(const OptionStatement& option) {
  if (!option.choices.empty()) return Offers::kWords;
  if (option.value == "CASE") return Offers::kCases;
  if (option.value == "DIR") return Offers::kFolders;
  const auto is = [&](const char* value) { return option.value == value; };
  return is("FILE") || is("PEM") || is("SRC") || is("TOKEN") ? Offers::kFiles : Offers::kNothing;
}

std::string words_of(const std::vector<std::string>& words) {
  std::string out;
  for (const std::string& word : words) out += (out.empty() ? "" : " ") + word;
  return out;
}

/// Every command that can be run, depth first.
void for_each_command(const Command& command, const std::function<void(const Command&)>& visit) {
  visit(command);
  for (const auto& child : command.commands()) for_each_command(*child, visit);
}

/// "token verify" for "kiroku token verify", "" for the program itself.
std::string path_of(const Command& command) {
  const std::size_t space = command.full_name().find(' ');
  return space == std::string::npos ? "" : command.full_name().substr(space + 1);
}

std::vector<std::string> option_names(const Command& command) {
  std::vector<std::string> names;
  for (const OptionStatement& option : command.options()) {
    names.insert(names.end(), option.names.begin(), option.names.end());
  }
  return names;
}

std::vector<std::string> command_names(const Command& command) {
  std::vector<std::string> names;
  for (const auto& child : command.commands()) names.push_back(child->name());
  return names;
}

std::string bash_reply(const OptionStatement& option) {
  switch (offers_of(option)) {
    case Offers::kWords:
      return "COMPREPLY=($(compgen -W '" + words_of(option.choices) + "' -- \"$word\"))";
    case Offers::kFiles:
      return "compopt -o filenames; COMPREPLY=($(compgen -f -- \"$word\"))";
    case Offers::kFolders:
      return "compopt -o filenames; COMPREPLY=($(compgen -d -- \"$word\"))";
    case Offers::kCases:
      return "_kiroku_cases";
    case Offers::kNothing:
      break;
  }
  return "COMPREPLY=()";
}

/// Names of value-taking options with what they offer: "token verify|--data) … ;;".
std::string bash_option_cases(const Command& command) {
  std::string out;
  for (const OptionStatement& option : command.options()) {
    if (option.is_flag()) continue;
    std::string pattern;
    for (const std::string& name : option.names) {
      pattern += (pattern.empty() ? "" : "|") + ("'" + path_of(command) + " " + name + "'");
    }
    out += "    " + pattern + ") " + bash_reply(option) + "; return ;;\n";
  }
  return out;
}

std::string bash_command_case(const Command& command) {
  std::string out = "    '" + path_of(command) + "')\n";
  out += "      if [[ $word == -* ]]; then COMPREPLY=($(compgen -W '" + words_of(option_names(command)) +
         "' -- \"$word\")); return; fi\n";
  if (!command.arguments().empty()) out += "      " + bash_reply(command.arguments().front()) + "\n";
  if (!command.commands().empty()) {
    out += std::string("      COMPREPLY") + (command.arguments().empty() ? "" : "+") + "=($(compgen -W '" +
           words_of(command_names(command)) + "' -- \"$word\"))\n";
  }
  return out + "      ;;\n";
}

/// Quotes for a single-quoted zsh word inside _arguments, where ':' and '[' mean something.
std::string zsh_description(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '\'') {
      out += "'\\''";
    } else if (c == ':' || c == '[' || c == ']' || c == '\\') {
      out += std::string("\\") + c;
    } else {
      out += c;
    }
  }
  return out;
}

std::string zsh_action(const OptionStatement& option) {
  switch (offers_of(option)) {
    case Offers::kWords:
      return "(" + words_of(option.choices) + ")";
    case Offers::kFiles:
      return "_files";
    case Offers::kFolders:
      return "_files -/";
    case Offers::kCases:
      return "_kiroku_cases";
    case Offers::kNothing:
      break;
  }
  return " ";
}

std::string zsh_specifications(const Command& command) {
  std::string out;
  for (const OptionStatement& option : command.options()) {
    for (const std::string& name : option.names) {
      out += " \\\n    '" + std::string(option.repeatable ? "*" : "") + name + "[" +
             zsh_description(option.description) + "]" +
             (option.is_flag() ? "" : ":" + zsh_description(option.value) + ":" + zsh_action(option)) + "'";
    }
  }
  if (!command.commands().empty()) return out;
  for (const OptionStatement& argument : command.arguments()) {
    out += " \\\n    '" + std::string(argument.repeatable ? "*" : "") + ":" +
           zsh_description(argument.value) + ":" + zsh_action(argument) + "'";
  }
  return out;
}

std::string zsh_function_name(const Command& command) {
  std::string name = "_" + command.full_name();
  std::replace(name.begin(), name.end(), ' ', '_');
  return name;
}

std::string zsh_function(const Command& command) {
  std::string out = zsh_function_name(command) + "() {\n";
  if (command.commands().empty()) return out + "  _arguments -s" + zsh_specifications(command) + "\n}\n\n";
  out += "  local -a commands=(";
  for (const auto& child : command.commands()) {
    out += "\n    '" + child->name() + ":" + zsh_description(child->purpose()) + "'";
  }
  out += ")\n  _arguments -C" + zsh_specifications(command) +
         " \\\n    '1:command:->command' '*::argument:->argument'\n";
  // What a command takes by itself, where no command below it is named.
  const std::string own = command.arguments().empty() ? "" : zsh_action(command.arguments().front());
  out += "  case $state in\n    command) _describe command commands" + (own.empty() ? "" : "; " + own) +
         " ;;\n    argument)\n      case $words[1] in\n";
  for (const auto& child : command.commands()) {
    out += "        " + child->name() + ") " + zsh_function_name(*child) + " ;;\n";
  }
  if (!own.empty()) out += "        *) " + own + " ;;\n";
  return out + "      esac ;;\n  esac\n}\n\n";
}

}  // namespace

std::string bash_completion(const Command& program) {
  std::string option_cases, command_cases, paths;
  for_each_command(program, [&](const Command& command) {
    option_cases += bash_option_cases(command);
    command_cases += bash_command_case(command);
    if (!path_of(command).empty()) paths += "'" + path_of(command) + "'|";
  });
  paths.pop_back();
  return "# bash completion of " + program.name() + ": source <(" + program.name() + " completion bash)\n" +
         R"(_kiroku_cases() {
  local archive=${KIROKU_HOME:-${XDG_DATA_HOME:-$HOME/.local/share}/kiroku}/archive
  compopt -o filenames
  COMPREPLY=($(compgen -d -- "$word") $(cd "$archive" 2>/dev/null && compgen -d -X log -- "$word"))
}
_kiroku() {
  local word=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD-1]} command= i
  for ((i = 1; i < COMP_CWORD; i++)); do
    case "${command:+$command }${COMP_WORDS[i]}" in
    )" + paths +
         R"() command="${command:+$command }${COMP_WORDS[i]}" ;;
    esac
  done
  COMPREPLY=()
  case "$command $previous" in
)" + option_cases +
         R"(  esac
  case "$command" in
)" + command_cases +
         R"(  esac
}
complete -F _kiroku )" +
         program.name() + "\n";
}

std::string zsh_completion(const Command& program) {
  std::string functions;
  for_each_command(program, [&](const Command& command) { functions += zsh_function(command); });
  return "#compdef " + program.name() + "\n# zsh completion of " + program.name() + ": save as _" +
         program.name() + " in a folder of $fpath\n" +
         R"(_kiroku_cases() {
  local archive=${KIROKU_HOME:-${XDG_DATA_HOME:-$HOME/.local/share}/kiroku}/archive
  local -a cases=($archive/*(N/:t))
  compadd -- ${cases:#log}
  _files -/
}

)" + functions +
         "if [[ $funcstack[1] == _" + program.name() + " ]]; then\n  _" + program.name() +
         " \"$@\"\nelse\n  compdef _" + program.name() + " " + program.name() + "\nfi\n";
}

}  // namespace kiroku::apps
