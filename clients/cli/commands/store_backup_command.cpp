#include <CLI/CLI.hpp>

#include "clients/cli/commands/commands.h"
#include "clients/cli/terminal/output.h"
#include "server/store/backup.h"
#include "server/store/store_place.h"

namespace trammel::cli {

namespace {

struct StoreBackupArguments {
  std::string store, output, check, json;
};

std::string text_of(const std::string& path, const StoreCopy& copy) {
  return fmt::format("{}: whole: {} model versions, {} batches, {} audit rows, {:.1f} MB\n{}", path,
                     copy.models, copy.batches, copy.audit_rows,
                     static_cast<double>(copy.bytes) / 1e6,
                     copy.audit_hash.empty() ? "" : "last audit row: " + copy.audit_hash + "\n");
}

nlohmann::ordered_json json_of(const std::string& path, const StoreCopy& copy) {
  return {{"file", path},
          {"store", copy.identity},
          {"bytes", copy.bytes},
          {"models", copy.models},
          {"batches", copy.batches},
          {"audit_rows", copy.audit_rows},
          {"audit_hash", copy.audit_hash}};
}

Status back_up(const StoreBackupArguments& arguments) {
  const bool copies = !arguments.store.empty() && !arguments.output.empty();
  if (copies == !arguments.check.empty() ||
      (!copies && !(arguments.store + arguments.output).empty()))
    return failure(ErrorCode::kUsage,
                   "either --store and --output, to copy a store, or --check, to look at a copy")
        .of("--store");
  if (is_postgres_url(arguments.store))
    return refused(
               "is a database: pg_dump makes a copy of it, and archiving its journal goes back to "
               "any moment")
        .in(spoken_place(arguments.store))
        .next("see server/store/README.md, or trammel store copy to a file");
  Result<StoreCopy> copy;
  if (copies) {
    ProgressLine line;
    copy = back_up_store(arguments.store, arguments.output,
                         [&line](double share) { line.show("copying", share); });
  } else {
    copy = check_store_copy(arguments.check);
  }
  if (!copy) return tl::make_unexpected(copy.error());
  const std::string& path = copies ? arguments.output : arguments.check;
  tell(text_of(path, *copy), {arguments.json});
  return write_json(arguments.json, json_of(path, *copy));
}

}  // namespace

void add_store_backup_command(CLI::App& app, Action& chosen) {
  const auto arguments = std::make_shared<StoreBackupArguments>();
  CLI::App* command = app.add_subcommand(
      "backup",
      "Copy a store as it is at one moment, also while a service writes it, and check the copy");
  command->add_option("--store", arguments->store, "The store's file, on this host");
  command->add_option("-o,--output", arguments->output,
                      "The copy; refused where there is such a file");
  command->add_option(
      "--check", arguments->check,
      "Only check this copy: pages, audit trail, batches and models by their hashes");
  command->add_option("--json", arguments->json,
                      "Write what the copy holds as JSON (- = standard output)");
  command->footer(
      "To go back to a copy: stop the service, put the copy in the store's place, start the "
      "service. Models that were\n"
      "put in force later are taken back from `<store>.models` beside it; move that away where "
      "they are not wanted.");
  command->callback([arguments, &chosen] { chosen = [arguments] { return back_up(*arguments); }; });
}

}  // namespace trammel::cli
