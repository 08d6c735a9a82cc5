// Completion of shells and manual pages, from the same declarations as --help.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/text.h"
#include "cli/usage.h"
#include "cli/verb.h"
#include "data/atomic_file.h"

namespace unfurl::cli {

namespace {

namespace fs = std::filesystem;

struct OptionText {
  std::vector<std::string> names;  // "--output", "-o"; of a positional its name alone
  bool positional = false, takes_value = false, required = false;
  std::string type, what;
  std::vector<std::string> words;  // that its value may be; empty: any
};

struct VerbText {
  std::string name, what, footer;
  std::vector<OptionText> options;
};

VerbText TextOf(const CLI::App& app) {
  VerbText verb{app.get_name(), app.get_description(), app.get_footer(), {}};
  for (const CLI::Option* option : app.get_options()) {
    OptionText text;
    text.positional = option->get_lnames().empty() && option->get_snames().empty();
    if (text.positional) text.names.push_back(option->get_name());
    for (const std::string& name : option->get_lnames()) text.names.push_back("--" + name);
    for (const std::string& name : option->get_snames()) text.names.push_back("-" + name);
    text.takes_value = option->get_expected_max() > 0;
    text.required = option->get_required();
    text.type = ReadableType(option->get_type_name());
    text.what = option->get_description();
    if (text.type.find('|') != std::string::npos) text.words = Split(text.type, '|');
    verb.options.push_back(std::move(text));
  }
  return verb;
}

std::vector<VerbText> VerbsOf(const CLI::App& program) {
  std::vector<VerbText> verbs;
  for (const CLI::App* app : program.get_subcommands([](const CLI::App*) { return true; })) {
    verbs.push_back(TextOf(*app));
  }
  return verbs;
}

std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size()) {
    text.replace(at, from.size(), to);
  }
  return text;
}

std::string NamesOf(const std::vector<VerbText>& verbs) {
  std::string names = "help";
  for (const VerbText& verb : verbs) names += " " + verb.name;
  return names;
}

// Words that the first positional argument of a verb may be.
std::string WordsOf(const VerbText& verb) {
  std::string words;
  for (const OptionText& option : verb.options) {
    if (!option.positional) continue;
    for (const std::string& word : option.words) words += (words.empty() ? "" : " ") + word;
    break;
  }
  return words;
}

std::string BashText(const std::vector<VerbText>& verbs) {
  std::string text =
      "# Completion of unfurl for bash; made by `unfurl completion bash`.\n"
      "_unfurl() {\n"
      "  local current=${COMP_WORDS[COMP_CWORD]} options= words=\n"
      "  if ((COMP_CWORD == 1)); then\n";
  text += fmt::format("    COMPREPLY=($(compgen -W '{} --help --version' -- \"$current\"))\n",
                      NamesOf(verbs));
  text += "    return\n  fi\n  case ${COMP_WORDS[1]} in\n";
  text += fmt::format("    help) words='{}' ;;\n", NamesOf(verbs));
  for (const VerbText& verb : verbs) {
    std::string options;
    for (const OptionText& option : verb.options) {
      if (!option.positional) options += (options.empty() ? "" : " ") + option.names.front();
    }
    text += fmt::format("    {}) options='{}' words='{}' ;;\n", verb.name, options, WordsOf(verb));
  }
  text +=
      "  esac\n"
      "  if [[ $current == -* ]]; then\n"
      "    COMPREPLY=($(compgen -W \"$options\" -- \"$current\"))\n"
      "  elif [[ -n $words && $COMP_CWORD == 2 ]]; then\n"
      "    COMPREPLY=($(compgen -W \"$words\" -- \"$current\"))\n"
      "  fi\n"
      "}\n"
      "complete -o bashdefault -o default -F _unfurl unfurl\n";
  return text;
}

// In single quotes, in brackets of zsh's _arguments.
std::string ZshQuoted(const std::string& text) {
  return Replaced(Replaced(Replaced(Replaced(text, "'", "'\\''"), "[", "\\["), "]", "\\]"), ":",
                  "\\:");
}

std::string ZshText(const std::vector<VerbText>& verbs) {
  std::string text =
      "#compdef unfurl\n# Completion of unfurl for zsh; made by `unfurl completion zsh`.\n"
      "local -a verbs\nverbs=(\n  'help:The help of a verb'\n";
  for (const VerbText& verb : verbs) {
    text += fmt::format("  '{}:{}'\n", verb.name, ZshQuoted(verb.what));
  }
  text +=
      ")\nif ((CURRENT == 2)); then\n  _describe verb verbs\n  return\nfi\n"
      "local verb=$words[2]\nshift words\n((CURRENT--))\ncase $verb in\n"
      "  help) _describe verb verbs ;;\n";
  for (const VerbText& verb : verbs) {
    text += fmt::format("  {})\n    _arguments", verb.name);
    for (const OptionText& option : verb.options) {
      if (option.positional) continue;
      for (const std::string& name : option.names) {
        text += fmt::format(" \\\n      '{}[{}]{}'", name, ZshQuoted(option.what),
                            option.takes_value ? ":" + ZshQuoted(option.type) + ":_files" : "");
      }
    }
    const std::string words = WordsOf(verb);
    text += words.empty() ? " \\\n      '*:file:_files'"
                          : fmt::format(" \\\n      '1:word:({})' '*:file:_files'", words);
    text += "\n    ;;\n";
  }
  return text + "esac\n";
}

std::string FishText(const std::vector<VerbText>& verbs) {
  std::string text = "# Completion of unfurl for fish; made by `unfurl completion fish`.\n";
  const auto quoted = [](const std::string& words) { return Replaced(words, "'", "\\'"); };
  for (const VerbText& verb : verbs) {
    text += fmt::format("complete -c unfurl -n __fish_use_subcommand -a {} -d '{}'\n", verb.name,
                        quoted(verb.what));
    const std::string in =
        fmt::format("complete -c unfurl -n '__fish_seen_subcommand_from {}'", verb.name);
    const std::string words = WordsOf(verb);
    if (!words.empty()) text += fmt::format("{} -a '{}'\n", in, words);
    for (const OptionText& option : verb.options) {
      if (option.positional) continue;
      text += in;
      for (const std::string& name : option.names) {
        text += name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1);
      }
      text += fmt::format("{} -d '{}'\n", option.takes_value ? " -r" : "", quoted(option.what));
    }
  }
  return text;
}

// For roff: a line may not begin with a point or a quote, and hyphens are minus signs.
std::string RoffQuoted(const std::string& text) {
  std::string out = Replaced(Replaced(text, "\\", "\\e"), "-", "\\-");
  out = Replaced(Replaced(out, "\n.", "\n\\&."), "\n'", "\n\\&'");
  if (out.starts_with(".") || out.starts_with("'")) out.insert(0, "\\&");
  return out;
}

std::string RoffHead(const std::string& name, const std::string& what) {
  return fmt::format(
      ".\\\" Manual page of unfurl; {}`.\n.TH {} 1 \"\" \"{}\" \"User Commands\"\n.SH NAME\n{} \\- "
      "{}\n",
      MadeByWords("completion"), Replaced(name, "-", "\\-"), data::ProgramVersion(),
      Replaced(name, "-", "\\-"), RoffQuoted(what));
}

std::string VerbPage(const VerbText& verb) {
  std::string text = RoffHead("unfurl-" + verb.name, verb.what);
  text += fmt::format(".SH SYNOPSIS\n.B unfurl {}\n[\\fIOPTIONS\\fR]", verb.name);
  for (const OptionText& option : verb.options) {
    if (!option.positional) continue;
    const std::string name = "\\fI" + RoffQuoted(option.names[0]) + "\\fR";
    text += option.required ? " " + name : " [" + name + "]";
  }
  text += "\n.SH OPTIONS\n";
  for (const bool positional : {true, false}) {
    for (const OptionText& option : verb.options) {
      if (option.positional != positional) continue;
      text += ".TP\n";
      for (std::size_t i = 0; i < option.names.size(); ++i) {
        text += (i > 0 ? ", " : "") + ("\\fB" + RoffQuoted(option.names[i]) + "\\fR");
      }
      if (option.takes_value && !positional) text += " \\fI" + RoffQuoted(option.type) + "\\fR";
      text += "\n" + RoffQuoted(option.what) + "\n";
    }
  }
  if (!verb.footer.empty()) text += ".SH EXAMPLE\n.nf\n" + RoffQuoted(verb.footer) + "\n.fi\n";
  return text + ".SH SEE ALSO\n.BR unfurl (1)\n";
}

std::string ProgramPage(const CLI::App& program, const std::vector<VerbText>& verbs) {
  std::string text = RoffHead("unfurl", program.get_description());
  text += ".SH SYNOPSIS\n.B unfurl\n\\fIVERB\\fR [\\fIOPTIONS\\fR] ...\n.SH VERBS\n";
  for (const VerbText& verb : verbs) {
    text += fmt::format(".TP\n.BR unfurl\\-{} (1)\n{}\n", verb.name, RoffQuoted(verb.what));
  }
  return text + ".SH DESCRIPTION\n.nf\n" + RoffQuoted(program.get_footer()) + "\n.fi\n";
}

// DIR/man/man1/unfurl.1, DIR/bash-completion/completions/unfurl ..: what a share folder holds.
std::vector<std::pair<std::string, std::string>> ShareFiles(const CLI::App& program) {
  const std::vector<VerbText> verbs = VerbsOf(program);
  std::vector<std::pair<std::string, std::string>> files = {
      {"man/man1/unfurl.1", ProgramPage(program, verbs)}};
  for (const VerbText& verb : verbs) {
    files.emplace_back(fmt::format("man/man1/unfurl-{}.1", verb.name), VerbPage(verb));
  }
  files.emplace_back("bash-completion/completions/unfurl", BashText(verbs));
  files.emplace_back("zsh/vendor-completions/_unfurl", ZshText(verbs));
  files.emplace_back("fish/vendor_completions.d/unfurl.fish", FishText(verbs));
  return files;
}

int WriteShare(const CLI::App& program, const fs::path& folder) {
  for (const auto& [path, text] : ShareFiles(program)) {
    std::error_code failed;
    fs::create_directories((folder / path).parent_path(), failed);
    if (failed) {
      throw Error("cannot be made: " + failed.message(), (folder / path).parent_path().string(),
                  "name a folder to write in", ErrorKind::kMachine);
    }
    data::WriteTextFile((folder / path).string(), text);
  }
  return kExitGood;
}

std::string TextFor(const CLI::App& program, const std::string& what) {
  const std::vector<VerbText> verbs = VerbsOf(program);
  if (what == "bash") return BashText(verbs);
  if (what == "zsh") return ZshText(verbs);
  if (what == "fish") return FishText(verbs);
  if (what == "man") return ProgramPage(program, verbs);
  throw Error(fmt::format("there is no completion for '{}'", what), "SHELL",
              "known: bash, zsh, fish, and man for the manual page");
}

}  // namespace

Verb AddCompletion(CLI::App& program, Common& common) {
  Verb verb = DeclareVerb(
      program, common, "completion", "Completion of this program's words for a shell; manual pages",
      "unfurl completion bash > ~/.local/share/bash-completion/completions/unfurl");
  auto shell = std::make_shared<std::string>(), folder = std::make_shared<std::string>();
  verb.app->add_option("SHELL", *shell, "Prints it for this shell; man: the manual page")
      ->type_name("bash|zsh|fish|man");
  const auto names = [&program] {
    std::vector<std::string> paths;
    for (const auto& [path, text] : ShareFiles(program)) paths.push_back(path);
    return paths;
  };
  verb.files->WriteFolder("--into", folder.get(), names,
                          "Instead: writes all of them and a manual page for each verb below this "
                          "share folder, as ~/.local/share");
  verb.run = [&program, &common, shell, folder] {
    if (!folder->empty()) return WriteShare(program, *folder);
    if (shell->empty()) {
      throw Error("names no shell", "SHELL", "name bash, zsh or fish, or give --into FOLDER");
    }
    const std::string text = TextFor(program, *shell);
    Finish(common, {{"shell", *shell}, {"text", text}}, text);
    return static_cast<int>(kExitGood);
  };
  return verb;
}

}  // namespace unfurl::cli
