#include <pwd.h>
#include <unistd.h>

#include <CLI/CLI.hpp>

#include "clients/cli/commands/commands.h"
#include "clients/cli/terminal/options.h"
#include "clients/cli/terminal/output.h"
#include "server/store/reopen.h"
#include "server/store/store_copy.h"
#include "server/store/store_describe.h"
#include "server/store/store_init.h"
#include "server/store/store_place.h"

namespace trammel::cli {

namespace {

struct StoreArguments {
  std::string place, to, role, cell, server, json;
  bool keep_source = false;
};

std::string text_of(const std::string& place, const StoreContent& content) {
  std::string text =
      fmt::format("{}: whole, {} audit rows, the last is {}\n", place, content.audit_rows,
                  content.audit_hash.empty() ? "none" : content.audit_hash);
  for (const StoreContent::Table& table : content.tables) {
    if (table.rows > 0)
      text +=
          fmt::format("  {:<18} {:>8}  {}\n", table.name, table.rows, table.sha256.substr(0, 16));
  }
  return text;
}

nlohmann::ordered_json json_of(const std::string& place, const StoreContent& content) {
  nlohmann::ordered_json tables = nlohmann::ordered_json::array();
  for (const StoreContent::Table& table : content.tables)
    tables.push_back({{"table", table.name}, {"rows", table.rows}, {"sha256", table.sha256}});
  return {{"place", place},
          {"store", content.identity},
          {"audit_rows", content.audit_rows},
          {"audit_hash", content.audit_hash},
          {"tables", std::move(tables)}};
}

Status init(const StoreArguments& arguments) {
  TRY(init_store(arguments.place, arguments.role));
  const std::string place = spoken_place(arguments.place);
  tell(fmt::format("{} is a store{}\n", place,
                   arguments.role.empty() ? "" : "; " + arguments.role + " may use it"),
       {arguments.json});
  return write_json(arguments.json, {{"place", place}, {"granted", arguments.role}});
}

Status say(const Result<StoreContent>& content, const std::string& place,
           const StoreArguments& arguments) {
  if (!content) return tl::make_unexpected(content.error());
  tell(text_of(spoken_place(place), *content), {arguments.json});
  return write_json(arguments.json, json_of(spoken_place(place), *content));
}

Status check(const StoreArguments& arguments) {
  return say(look_through_store(arguments.place), arguments.place, arguments);
}

Status copy(const StoreArguments& arguments) {
  ProgressLine line;
  return say(copy_store(arguments.place, arguments.to,
                        arguments.keep_source ? SourceAfter::kKept : SourceAfter::kMoved,
                        [&line](double share) { line.show("copying", share); }),
             arguments.to, arguments);
}

Status reopen(const StoreArguments& arguments) {
  TRY(reopen_store(arguments.place));
  const std::string place = spoken_place(arguments.place);
  tell(fmt::format("{} may be served again\n", place), {arguments.json});
  return write_json(arguments.json, {{"place", place}});
}

std::string text_of(const std::vector<CellInRecord>& cells) {
  std::string text = cells.empty() ? "no server has told of a cell\n" : "";
  for (const CellInRecord& one : cells) {
    text += fmt::format("{}: as {} has it\n", one.cell, one.server);
    for (const CellOfServer& server : one.servers)
      text += fmt::format("  {} (on {}{}): {}\n", server.server, server.host,
                          server.is_gone ? ", gone" : "",
                          server.differs.empty() ? "the same" : "another " + server.differs);
  }
  return text;
}

nlohmann::ordered_json json_of(const std::vector<CellInRecord>& cells) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const CellInRecord& one : cells) {
    nlohmann::ordered_json servers = nlohmann::ordered_json::array();
    for (const CellOfServer& server : one.servers)
      servers.push_back({{"server", server.server},
                         {"host", server.host},
                         {"gone", server.is_gone},
                         {"differs", server.differs}});
    list.push_back({{"cell", one.cell},
                    {"server", one.server},
                    {"since_unix_s", one.since},
                    {"cell_file", one.files.cell},
                    {"robot_file", one.files.robot},
                    {"servers", std::move(servers)}});
  }
  return list;
}

/// The user who runs the command, for the audit trail.
std::string who_asks() {
  const ::passwd* user = ::getpwuid(::getuid());
  return fmt::format("{} by trammel store describe",
                     user == nullptr ? std::to_string(::getuid()) : user->pw_name);
}

Status describe(const StoreArguments& arguments) {
  if (arguments.cell.empty() != arguments.server.empty())
    return failure(ErrorCode::kUsage, "--cell and --as go together: whose files of the cell count")
        .of("--as");
  if (!arguments.cell.empty()) {
    const Status told =
        describe_cell(arguments.place, arguments.cell, arguments.server, who_asks());
    if (!told) return told;
  }
  const auto cells = TRY(described_cells(arguments.place));
  tell(text_of(cells), {arguments.json});
  return write_json(arguments.json,
                    {{"place", spoken_place(arguments.place)}, {"cells", json_of(cells)}});
}

using Run = Status (*)(const StoreArguments&);

CLI::App* add(CLI::App& store, Action& chosen, const char* name, const char* what, Run run,
              const std::shared_ptr<StoreArguments>& arguments) {
  CLI::App* command = store.add_subcommand(name, what);
  add_json_option(*command, arguments->json);
  command->callback(
      [arguments, run, &chosen] { chosen = [arguments, run] { return run(*arguments); }; });
  return command;
}

}  // namespace

void add_store_command(CLI::App& app, Action& chosen) {
  CLI::App* store = app.add_subcommand(
      "store", "Make, check and move the store of a service, a file or a PostgreSQL");
  store->require_subcommand(1);
  const auto arguments = std::make_shared<StoreArguments>();
  CLI::App* made =
      add(*store, chosen, "init",
          "Make an empty PostgreSQL database a store, or bring one up to date", init, arguments);
  made->add_option("URL", arguments->place,
                   "postgresql://OWNER@HOST/DATABASE, as the role that is to own it")
      ->required();
  made->add_option(
      "--grant", arguments->role,
      "Let this role use it; it may add to the audit trail, and neither change nor delete it");
  CLI::App* checked =
      add(*store, chosen, "check", "Look through a whole store, also while services use it", check,
          arguments);
  checked->add_option("STORE", arguments->place, "A file, or a URL of PostgreSQL")->required();
  CLI::App* copied =
      add(*store, chosen, "copy", "Move a store that no service writes, verified table by table",
          copy, arguments);
  copied->add_flag(
      "--keep-source", arguments->keep_source,
      "It stays as it is, to be served further. Without this no server serves it any more");
  copied->add_option("FROM", arguments->place, "A file, or a URL of PostgreSQL")->required();
  copied
      ->add_option("TO", arguments->to,
                   "The same; a file that is not there, or a database that is empty")
      ->required();
  copied->footer(
      "Stop the services first. Then name TO in the server file. The audit trail of FROM ends with "
      "where it went, and\n"
      "servers refuse it from then on; `store reopen` takes that back.");
  CLI::App* reopened =
      add(*store, chosen, "reopen",
          "Have a store served again that was moved, since TO is given up", reopen, arguments);
  reopened->add_option("STORE", arguments->place, "A file, or a URL of PostgreSQL")->required();
  CLI::App* described =
      add(*store, chosen, "describe",
          "Show whose files each cell goes by among the servers of one record, or choose", describe,
          arguments);
  described
      ->add_option("URL", arguments->place,
                   "postgresql://ROLE@HOST/DATABASE, as a server of it has it")
      ->required();
  described->add_option("--cell", arguments->cell, "Cell whose description is chosen");
  described->add_option("--as", arguments->server,
                        "Server whose cell file and robot file count from now on; who has others "
                        "does not answer for the cell until it has the same");
}

}  // namespace trammel::cli
