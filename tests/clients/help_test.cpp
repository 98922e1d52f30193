#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iomanip>
#include <sstream>

#include "clients/cli/command_line.h"
#include "clients/cli/commands/commands.h"
#include "clients/cli/terminal/command_tree.h"
#include "clients/cli/terminal/defaults.h"
#include "clients/cli/terminal/help_topics.h"
#include "clients/cli/terminal/names.h"
#include "clients/cli/terminal/output.h"
#include "clients/cli/text/manual.h"
#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"

namespace trammel::cli {
namespace {

/// The whole command line, as the program makes it.
class Help : public testing::Test {
 protected:
  Help() { make_command_line(app_, chosen_); }

  [[nodiscard]] std::vector<CLI::App*> commands() {
    return app_.get_subcommands([](CLI::App* one) { return !one->get_name().empty(); });
  }
  static std::string help_of(const CLI::App& command) {
    return command.get_formatter()->make_help(&command, "trammel " + command.get_name(),
                                              CLI::AppFormatMode::Normal);
  }
  static std::vector<std::string> lines_of(const std::string& text) {
    std::istringstream in(text);
    std::vector<std::string> lines;
    for (std::string line; std::getline(in, line);) lines.push_back(line);
    return lines;
  }
  static std::vector<std::string> words_of(const std::string& line) {
    std::vector<std::string> words;
    std::istringstream in(line);
    for (std::string word; in >> std::quoted(word);) words.push_back(word);
    return words;
  }

  CLI::App app_{"Makes robots land.", "trammel"};
  Action chosen_;
  test::TemporaryFolder folder_;
};

TEST_F(Help, OfEveryCommandFitsIn80ColumnsWithoutBrokenWords) {
  for (CLI::App* command : commands()) {
    const std::string help = help_of(*command);
    for (const std::string& line : lines_of(help))
      EXPECT_LE(line.size(), 80u) << command->get_name() << ": " << line;
    const std::string all = fmt::format(" {} ", fmt::join(words_of(help), " "));
    for (const OptionText& option : described(*command).options) {
      for (const std::string& word : words_of(option.description))
        EXPECT_NE(all.find(" " + word + " "), std::string::npos)
            << command->get_name() << " breaks " << word;
    }
  }
  EXPECT_GE(commands().size(), 35u);
}

TEST_F(Help, OfEveryCommandHasExamplesThatTheCommandLineTakes) {
  for (CLI::App* command : commands()) {
    const std::string examples(examples_of(command->get_name()));
    EXPECT_FALSE(examples.empty()) << command->get_name();
    EXPECT_NE(help_of(*command).find(examples), std::string::npos) << command->get_name();
    for (const std::string& line : lines_of(examples)) {
      EXPECT_LE(line.size(), 80u) << line;
      std::vector<std::string> words =
          words_of(line.starts_with("  trammel ") ? line.substr(10) : line);
      if (words[0] == "source") words = {"completion", "bash"};
      if (const auto into = std::find(words.begin(), words.end(), ">"); into != words.end())
        words.erase(into, words.end());
      CLI::App app("", "trammel");
      Action chosen;
      make_command_line(app, chosen);
      words = words_by_option(app, words, false);
      EXPECT_NO_THROW(app.parse(std::vector<std::string>(words.rbegin(), words.rend()))) << line;
      EXPECT_TRUE(static_cast<bool>(chosen)) << line;
      EXPECT_EQ(app.get_subcommands().front()->get_name(), command->get_name()) << line;
    }
  }
}

TEST_F(Help, TopicsFitIn80ColumnsAndTheirCommandsExist) {
  for (const HelpTopic& topic : help_topics()) {
    for (const std::string& line : lines_of(wrapped(topic.text))) {
      EXPECT_LE(line.size(), 80u) << topic.name << ": " << line;
      if (!line.starts_with("  trammel ")) continue;
      const std::string name = words_of(line)[1];
      const auto named = [&](const CLI::App* one) { return one->get_name() == name; };
      const auto all = commands();
      EXPECT_TRUE(std::any_of(all.begin(), all.end(), named)) << line;
    }
  }
}

TEST_F(Help, WhatIsPrintedFitsIn80Columns) {
  const auto fits = [](const std::string& about) {
    const char* words[] = {"trammel", "help", about.c_str()};
    testing::internal::CaptureStdout();
    EXPECT_EQ(run_command_line(about.empty() ? 2 : 3, words), 0) << about;
    for (const std::string& line : lines_of(testing::internal::GetCapturedStdout()))
      EXPECT_LE(line.size(), 80u) << about << ": " << line;
  };
  fits("");
  fits("all");
  for (const HelpTopic& topic : help_topics()) fits(std::string(topic.name));
  for (const CLI::App* command : commands()) fits(command->get_name());
}

/// What a command line says, with its exit code.
struct Said {
  std::string out, err;
  int exit_code = 0;
};
Said said(const std::vector<const char*>& words) {
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  const int code = run_command_line(static_cast<int>(words.size()), words.data());
  return {testing::internal::GetCapturedStdout(), testing::internal::GetCapturedStderr(), code};
}

TEST_F(Help, TheProgramAloneShowsTenCommandsInGroupsAndWhereToBegin) {
  const Said alone = said({"trammel"});
  EXPECT_EQ(alone.exit_code, 1) << "as git alone";
  EXPECT_EQ(alone.err, "");
  int shown = 0;
  for (const std::string& line : lines_of(alone.out)) {
    const auto words = words_of(line);
    const auto named = [&](const CLI::App* one) { return one->get_name() == words[0]; };
    const auto all = commands();
    if (line.starts_with("  ")) {
      EXPECT_TRUE(std::any_of(all.begin(), all.end(), named)) << line;
      ++shown;
    }
  }
  EXPECT_EQ(shown, 10);
  EXPECT_NE(alone.out.find("trammel help start"), std::string::npos);
  EXPECT_NE(alone.out.find("trammel help all"), std::string::npos);
  EXPECT_EQ(said({"trammel", "help"}).out, alone.out);
  const std::string all = said({"trammel", "help", "all"}).out;
  for (const CLI::App* command : commands())
    EXPECT_NE(all.find("\n  " + command->get_name() + " "), std::string::npos);
}

TEST_F(Help, AWordOfAnotherProgramIsLedToWhatDoesItHere) {
  for (const auto& [word, here] : {std::pair("calibrate", "trammel train"),
                                   {"list", "trammel status"},
                                   {"login", "--security FOLDER"},
                                   {"upload", "trammel submit"},
                                   {"measure", "trammel plan"},
                                   {"start", "trammel help start"},
                                   {"verify", "trammel check"},
                                   {"diff", "trammel compare"},
                                   {"serve", "trammeld --config"},
                                   {"formats", "trammel help formats"},
                                   {"evalute", "evaluate"}}) {
    const Said led = said({"trammel", word});
    EXPECT_EQ(led.exit_code, 2) << word;
    EXPECT_NE(led.err.find(here), std::string::npos) << led.err;
  }
  EXPECT_NE(said({"trammel", "train", "--data", "b.csv"}).err.find("did you mean --batch?"),
            std::string::npos);
  EXPECT_NE(said({"trammel", "status", "--server", "b"}).err.find("did you mean --host?"),
            std::string::npos);
}

TEST_F(Help, IsInTheRefusalWhereSomethingNeededWasLeftOut) {
  const std::string refused = said({"trammel", "train", "cell.yaml"}).err;
  EXPECT_NE(refused.find("--batch is required"), std::string::npos) << refused;
  EXPECT_NE(refused.find("write trammel train CELL BATCH... --output FILE"), std::string::npos)
      << refused;
}

TEST_F(Help, SaysWhatABareWordStandsFor) {
  const std::string help = said({"trammel", "activate", "--help"}).out;
  EXPECT_NE(help.find("Usage: trammel activate CELL@VERSION [OPTIONS]"), std::string::npos) << help;
  EXPECT_NE(help.find("CELL@VERSION or --model"), std::string::npos) << help;
  EXPECT_NE(said({"trammel", "train", "--help"}).out.find("trammel train CELL BATCH... --output"),
            std::string::npos);
}

TEST_F(Help, ManualPagesAndCompletionsHaveEveryCommandAndOption) {
  const CommandText program = described(app_);
  const auto pages = manual_pages(program, "1.2.3", folder_.path());
  ASSERT_EQ(pages.size(), program.commands.size() + 1);
  const std::string bash = bash_completion(program), zsh = zsh_completion(program),
                    fish = fish_completion(program);
  for (std::size_t k = 0; k < program.commands.size(); ++k) {
    const CommandText& command = program.commands[k];
    EXPECT_TRUE(pages[k + 1].path.ends_with("/trammel-" + command.name + ".1"));
    for (const OptionText& option : command.options) {
      const std::string name = option.names.back();
      std::string in_troff = name;
      for (auto at = in_troff.find('-'); at != std::string::npos; at = in_troff.find('-', at + 2))
        in_troff.replace(at, 1, "\\-");
      EXPECT_NE(pages[k + 1].text.find(in_troff), std::string::npos) << command.name << " " << name;
      if (option.positional) continue;
      EXPECT_NE(bash.find(name), std::string::npos) << name;
      EXPECT_NE(zsh.find(name + "["), std::string::npos) << name;
      if (name.starts_with("--")) {
        EXPECT_NE(fish.find("-l " + name.substr(2)), std::string::npos) << name;
      }
    }
  }
}

TEST_F(Help, TheShellCompletesCommandsOptionsAndTheirValues) {
  folder_.write("completion", bash_completion(described(app_)));
  const auto completed = [&](const std::string& words, int at) {
    const std::string script = fmt::format(
        "source {}; COMP_WORDS=({}); COMP_CWORD={}; _trammel; echo \"${{COMPREPLY[*]}}\"",
        folder_.file("completion"), words, at);
    return test::run({"/bin/bash", "-c", script}).out;
  };
  EXPECT_EQ(completed("trammel pl", 1), "plan\n");
  EXPECT_EQ(completed("trammel plan --cri", 2), "--criterion\n");
  EXPECT_EQ(completed("trammel convert --unit ''", 3), "inch m mm\n");
  EXPECT_EQ(completed("trammel help form", 2), "formats\n");
  EXPECT_EQ(completed("trammel train --batch ''", 3), "\n") << "files are the shell's own";
}

TEST_F(Help, DefaultsStandBehindWhatTheCommandLineSays) {
  const std::string path =
      folder_.write("defaults", "# of this desk\nport = 17501\nseed=7\ncell = /data/cell-7.yaml\n");
  using Words = std::vector<std::string>;
  EXPECT_EQ(with_defaults(app_, {"status"}, path).value(), (Words{"status", "--port", "17501"}));
  EXPECT_EQ(with_defaults(app_, {"status", "--port", "1"}, path).value(),
            (Words{"status", "--port", "1"}));
  EXPECT_EQ(with_defaults(app_, {"plan", "--count", "5"}, path).value(),
            (Words{"plan", "--count", "5", "--seed", "7", "--cell", "/data/cell-7.yaml"}));
  EXPECT_EQ(with_defaults(app_, {"jobs"}, path).value(), (Words{"jobs", "--port", "17501"}))
      << "all cells";
  EXPECT_EQ(with_defaults(app_, {"status"}, "").value(), (Words{"status"}));
  const std::string by_notepad = folder_.write("bom", "\xef\xbb\xbfport = 17501\r\n");
  EXPECT_EQ(with_defaults(app_, {"status"}, by_notepad).value(),
            (Words{"status", "--port", "17501"}));
  const auto unknown =
      with_defaults(app_, {"status"}, folder_.write("other", "port = 1\nprot = 2\n"));
  ASSERT_FALSE(unknown);
  EXPECT_EQ(unknown.error().row, 2);
  EXPECT_EQ(unknown.error().field, "prot");
  EXPECT_NE(unknown.error().message.find("did you mean port?"), std::string::npos);
}

TEST_F(Help, TellsTheTimeThatIsLeftOnceItIsKnown) {
  EXPECT_EQ(time_left(0.5, 0.5), "");
  EXPECT_EQ(time_left(10, 0.01), "");
  EXPECT_EQ(time_left(10, 0.2), ", about 40 s left");
  EXPECT_EQ(time_left(600, 0.5), ", about 10 min left");
  EXPECT_EQ(time_left(7200, 0.5), ", about 2.0 h left");
  EXPECT_EQ(time_left(600, 1), "");
}

}  // namespace
}  // namespace trammel::cli
