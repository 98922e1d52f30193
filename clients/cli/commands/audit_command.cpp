#include <CLI/CLI.hpp>

#include "clients/cli/commands/commands.h"
#include "clients/cli/terminal/options.h"
#include "clients/cli/terminal/output.h"
#include "clients/cli/text/audit_text.h"
#include "server/store/audit_json.h"
#include "server/store/store_place.h"

namespace trammel::cli {

namespace {

struct AuditArguments {
  std::string cell, store, json;
  std::int64_t since = 0;
  std::size_t last = 0;
  ServiceOptions service;
};

/// The audit trail of each server.
Result<std::vector<std::pair<std::string, AuditTrail>>> trails(const AuditArguments& arguments) {
  std::vector<std::pair<std::string, AuditTrail>> all;
  if (!arguments.store.empty()) {
    auto trail =
        TRY(read_audit(arguments.store, {arguments.cell, arguments.since, arguments.last}));
    all.emplace_back(spoken_place(arguments.store), std::move(trail));
    return all;
  }
  const auto session = TRY(open_session(arguments.service));
  const auto texts = TRY(session->audit(arguments.cell, arguments.since, arguments.last));
  for (const client::AuditText& text : texts) {
    auto trail = TRY(audit_of_json(text.json));
    all.emplace_back("server " + text.server, std::move(trail));
  }
  return all;
}

/// Checks the chain of every received row here as well, since a service may send anything.
Status check_rows(const AuditTrail& trail) {
  if (trail.broken) return tl::make_unexpected(*trail.broken);
  const AuditRow* before = nullptr;
  for (const AuditRow& row : trail.rows) {
    const bool follows =
        before == nullptr || row.number != before->number + 1 || row.hash_before == before->hash;
    if (row.hash != hash_of(row) || !follows) {
      return failure(ErrorCode::kInternal, "audit row {}: its content is not what was written",
                     row.number)
          .at_row(row.number);
    }
    before = &row;
  }
  return {};
}

Status audit(const AuditArguments& arguments) {
  const auto all = TRY(trails(arguments));
  std::string text;
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  std::optional<Error> broken;
  for (const auto& [where, trail] : all) {
    text += audit_text(trail, where);
    json.push_back(audit_json(trail));
    json.back()["where"] = where;
    if (const Status good = check_rows(trail); !good && !broken)
      broken = Failure(good.error()).in(where).value();
  }
  tell(text, {arguments.json});
  TRY(write_json(arguments.json, {{"trails", json}}));
  return broken ? Status(tl::make_unexpected(*broken)) : Status();
}

}  // namespace

void add_audit_command(CLI::App& app, Action& chosen) {
  const auto arguments = std::make_shared<AuditArguments>();
  CLI::App* command = app.add_subcommand(
      "audit",
      "Show who changed what and when, and verify that nothing of it was changed afterwards");
  command->add_option(
      "--store", arguments->store,
      "The file of a store, or its URL, instead of asking a service; also while one runs");
  command->add_option("--cell", arguments->cell, "Only what was changed of this cell");
  command->add_option("--since", arguments->since, "Only what was changed since then, Unix time, s")
      ->check(CLI::NonNegativeNumber);
  command->add_option("--last", arguments->last, "Only that many, the newest; left out: all");
  add_json_option(*command, arguments->json);
  add_options_of_service_command(*command, arguments->service);
  command->callback([arguments, &chosen] { chosen = [arguments] { return audit(*arguments); }; });
}

}  // namespace trammel::cli
