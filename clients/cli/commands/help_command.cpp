#include <CLI/CLI.hpp>
#include <filesystem>
#include <map>

#include "clients/cli/commands/commands.h"
#include "clients/cli/terminal/command_tree.h"
#include "clients/cli/terminal/help_topics.h"
#include "clients/cli/terminal/output.h"
#include "clients/cli/text/manual.h"
#include "server/base/near_miss.h"
#include "server/base/plain_text.h"

namespace trammel::cli {

namespace {

const CLI::App* command_called(const CLI::App& app, const std::string& name) {
  const auto found = app.get_subcommands(
      [&](const CLI::App* one) { return !name.empty() && one->get_name() == name; });
  return found.empty() ? nullptr : found.front();
}

std::string list_of_topics() {
  std::string text = "\nTopics, for trammel help TOPIC:\n";
  for (const HelpTopic& topic : help_topics())
    text += fmt::format("  {:<24}{}\n", topic.name, topic.title);
  return text;
}

Status help(const CLI::App& app, const std::string& about) {
  if (about.empty()) {
    tell(std::string(overview()), {});
    return {};
  }
  if (about == "all") {
    tell(app.get_formatter()->make_help(&app, "trammel", CLI::AppFormatMode::Normal) +
             list_of_topics(),
         {});
    return {};
  }
  if (const CLI::App* command = command_called(app, about)) {
    tell(command->get_formatter()->make_help(command, "trammel " + about,
                                             CLI::AppFormatMode::Normal),
         {});
    return {};
  }
  std::vector<std::string> known;
  for (const HelpTopic& topic : help_topics()) {
    if (topic.name == about) {
      tell(wrapped(fmt::format("{}: {}\n\n{}", topic.name, topic.title, topic.text)) + "\n", {});
      return {};
    }
    known.emplace_back(topic.name);
  }
  const std::size_t topics = known.size();
  for (const CLI::App* one : app.get_subcommands([](const CLI::App*) { return true; }))
    known.push_back(one->get_name());
  return failure(ErrorCode::kUsage, "{}: no such command or topic{}", shown_short(about),
                 did_you_mean(about, known))
      .of("topic")
      .with_text(shown_short(about))
      .next(fmt::format(
          "topics: {}",
          fmt::join(known.begin(), known.begin() + static_cast<std::ptrdiff_t>(topics), " ")));
}

Status complete(const CLI::App& app, const std::string& shell, const std::string& output) {
  const CommandText program = described(app);
  return write_output(output, shell == "bash"  ? bash_completion(program)
                              : shell == "zsh" ? zsh_completion(program)
                                               : fish_completion(program));
}

Status write_manual(const CLI::App& app, const std::string& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error)
    return refused("cannot be made: {}", error.message())
        .in(folder)
        .next("name a folder that you may write");
  const std::vector<TextFile> pages = manual_pages(described(app), app.version(), folder);
  TRY(write_text_files(pages));
  tell(fmt::format("{} pages in {}\n", pages.size(), folder), {});
  return {};
}

}  // namespace

void add_help_commands(CLI::App& app, Action& chosen) {
  const auto about = std::make_shared<std::string>();
  CLI::App* help_command =
      app.add_subcommand("help", "Tell about a command or a topic: formats, cell, units, ...");
  help_command->add_option("topic", *about, "A command or a topic, or all: the lists of both");
  help_command->callback(
      [&app, about, &chosen] { chosen = [&app, about] { return help(app, *about); }; });

  const auto shell = std::make_shared<std::string>();
  CLI::App* completion =
      app.add_subcommand("completion", "Write what a shell needs to complete commands and options");
  completion->add_option("shell", *shell, "Which shell")
      ->required()
      ->check(CLI::IsMember(std::vector<std::string>{"bash", "zsh", "fish"}));
  const auto output = std::make_shared<std::string>("-");
  completion->add_option("-o,--output", *output, "File to write")->capture_default_str();
  completion->callback([&app, shell, output, &chosen] {
    chosen = [&app, shell, output] { return complete(app, *shell, *output); };
  });

  const auto folder = std::make_shared<std::string>();
  CLI::App* manual = app.add_subcommand("manual", "Write the manual pages, one for each command");
  manual->add_option("-o,--output", *folder, "Folder to write them to; it is made")->required();
  manual->callback(
      [&app, folder, &chosen] { chosen = [&app, folder] { return write_manual(app, *folder); }; });
}

}  // namespace trammel::cli
