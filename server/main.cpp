// trammeld: creates the parts of the server, connects and runs them, and stops them in reverse
// order.
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/base/line_output.h"
#include "server/base/memory.h"
#include "server/base/plain_text.h"
#include "server/config/reload.h"
#include "server/config/server_config.h"
#include "server/config/start_check.h"
#include "server/dds/dds_service.h"
#include "server/dds/port_lock.h"
#include "server/dds/watchdog.h"
#include "server/gateway/gateway.h"
#include "server/host/caught_signals.h"
#include "server/host/log.h"
#include "server/host/service_manager.h"
#include "server/http/http_server.h"
#include "server/registry/model_registry.h"
#include "server/store/commit_safety.h"
#include "server/store/store.h"
#include "server/store/store_place.h"
#include "server/trainer/compute/compute_main.h"
#include "server/trainer/trainer.h"

namespace trammel {
namespace {

constexpr int kExitDark = 1;
constexpr int kExitUsage = 2;
constexpr int kExitRefused = 3;
constexpr int kExitUnreachable = 4;

struct Arguments {
  std::string config;
  bool check = false;
  std::optional<std::string> store;
  std::optional<std::uint16_t> port;
  std::optional<std::uint32_t> domain;
  std::optional<std::uint16_t> http_port;
};

/// Puts the options of the command line over the server file.
void put_over(ServerConfig& config, const Arguments& arguments) {
  if (arguments.store) config.store = *arguments.store;
  if (arguments.port) config.dds.port = *arguments.port;
  if (arguments.domain) config.dds.domain = *arguments.domain;
  if (arguments.http_port) config.http.port = *arguments.http_port;
}

int exit_code(const Error& error) {
  switch (error.code) {
    case ErrorCode::kUsage:
      return kExitUsage;
    case ErrorCode::kBusy:
    case ErrorCode::kUnreachable:
      return kExitUnreachable;
    default:
      return kExitRefused;
  }
}

/// Prints one line for each error.
int refuse(const Error& error) {
  LineOutput said(STDERR_FILENO);
  for (const Error& one : apart(error)) said.write(fmt::format("trammeld: {}\n", sentence(one)));
  return exit_code(error);
}

/// Prints the problems of a start that would fail.
int refuse_start(std::vector<Error> problems) {
  Error all = together(std::move(problems));
  all.code = ErrorCode::kRefused;
  return refuse(all);
}

/// Prints the result of a start on this host. Cells that would have no model are named in any case.
int check(const ServerReading& server, const std::string& path, StoreToCheck store) {
  const StartCheck found = check_start(server, path, store);
  for (const std::string& note : found.notes) fmt::print("{}\n", shown(note));
  LineOutput said(STDERR_FILENO);
  for (const std::string& dark : found.dark) said.write(fmt::format("trammeld: {}\n", shown(dark)));
  if (!found.problems.empty()) return refuse_start(found.problems);
  if (!found.dark.empty()) return kExitDark;
  const std::size_t cells = server.config.cells.size();
  fmt::print("{}: good, {} cell{}\n", path, cells, cells == 1 ? "" : "s");
  return 0;
}

void log_progress(const JobProgress& progress) {
  const LogAbout about = {{"cell", progress.cell}, {"job", std::to_string(progress.job)}};
  const std::string job = fmt::format("{}: job {}", progress.cell, progress.job);
  switch (progress.stage) {
    case JobStage::kQueued:
      if (progress.what.empty()) {
        tell(LogLevel::kInfo, "job_queued", job + " is queued", about);
      } else {
        tell(LogLevel::kWarn, "job_queued", fmt::format("{} is queued: {}", job, progress.what),
             about);
      }
      break;
    case JobStage::kTraining:
      tell(LogLevel::kDebug, "job_progress",
           fmt::format("{}: {}, {:.0f} %", job, progress.what, 100 * progress.share), about);
      break;
    case JobStage::kStoring:
      tell(LogLevel::kDebug, "job_progress", job + " is being stored", about);
      break;
    case JobStage::kDone:
      if (progress.model_version == 0) {
        tell(LogLevel::kInfo, "job_done", fmt::format("{} is done: {}", job, progress.what), about);
      } else {
        tell(LogLevel::kInfo, "job_done",
             fmt::format("{} made version {}, {}", job, progress.model_version, progress.what),
             about);
      }
      break;
    case JobStage::kFailed:
      tell(LogLevel::kWarn, "job_failed", fmt::format("{} failed: {}", job, progress.what), about);
      break;
  }
}

/// Logs a call. A flood of faulty calls does not fill the log: of each kind a few lines a minute
/// are written.
void log_call(const CallReport& call) {
  const std::string trace = call.trace.empty() ? "" : fmt::format(" (trace {})", call.trace);
  const LogAbout about = {{"cell", call.cell},   {"operation", call.operation},
                          {"who", call.client},  {"request", call.request},
                          {"trace", call.trace}, {"result", call.result}};
  const std::string what =
      fmt::format("{}: {} of request {}{}", call.cell, call.operation, call.request, trace);
  if (!call.refused.empty()) {
    tell(LogLevel::kInfo, "request_refused", fmt::format("{} is refused: {}", what, call.refused),
         about);
  } else {
    tell(LogLevel::kInfo, "request_done", what + " is done", about);
  }
}

/// Ignores signals that would end the process needlessly: a pipe without reader, and a file at its
/// size limit. Both become errors of the call in which they occur. The computing processes get the
/// signals unchanged.
void ignore_what_calls_report() {
  for (const int number : {SIGPIPE, SIGXFSZ}) {
    struct sigaction ignored {};
    ignored.sa_handler = SIG_IGN;
    ::sigaction(number, &ignored, nullptr);
  }
}

/// Cells that are served already stay as they are.
void add_cells(const ServedCells& cells, DdsService& service, Trainer& trainer) {
  for (const std::string& notice : trainer.add_cells(cells))
    tell(LogLevel::kWarn, "notice", notice);
  service.cells_added();
}

/// Reads the server file again and applies the changes that are possible while serving. A refused
/// file changes nothing.
void reload(const Arguments& arguments, ServerConfig& config, DdsService& service,
            Trainer& trainer) {
  tell_manager_reloading();
  ServerReading read = read_server(arguments.config);
  put_over(read.config, arguments);
  for (const Error& problem : read.problems)
    tell(LogLevel::kError, "reload_refused", "everything stays as it was: " + sentence(problem));
  if (read.problems.empty()) {
    const ReloadPlan plan = plan_reload(config, read.config);
    for (const std::string& key : plan.later)
      tell(LogLevel::kWarn, "reload_later", fmt::format("{} changes with the next start only", key),
           {{"key", key}});
    config = plan.config;
    change_log(config.log);
    service.set_limits(config.dds);
    trainer.set_limits(config.trainer.queue_capacity, config.trainer.keep);
    if (config.cells.size() > trainer.cells().size()) add_cells(config.cells, service, trainer);
    tell(LogLevel::kInfo, "reloaded",
         plan.now.empty() ? "read again: nothing has changed"
                          : fmt::format("read again, and taken on: {}", fmt::join(plan.now, ", ")));
  }
  tell_manager_ready("serves");
}

/// The parts of a running server, and the data that it reports.
struct Serving {
  ServerConfig& config;
  const Arguments& arguments;
  DdsService& service;
  Trainer& trainer;
  const ModelRegistry& registry;
};

/// Gives signs of life, and reads files again, until a signal ends it; returns that.
int watch(CaughtSignals& signals, const Serving& serving) {
  using std::chrono::milliseconds;
  constexpr milliseconds kTick{1000};
  const auto period = manager_watches_every();
  const milliseconds tick =
      period ? std::min(kTick, std::chrono::duration_cast<milliseconds>(*period) / 3) : kTick;
  std::string told;
  for (;;) {
    const CaughtSignals::News news = signals.wait(tick);
    if (news.ends != 0) return news.ends;
    if (news.reload) reload(serving.arguments, serving.config, serving.service, serving.trainer);
    if (serving.service.movement().still.empty()) tell_manager_alive();
    const std::string status =
        fmt::format("{} of {} cells have a model, {} jobs wait", serving.registry.cells_served(),
                    serving.trainer.cells().size(), serving.trainer.queued_jobs());
    if (status != told) tell_manager_status(status);
    told = status;
  }
}

void tell_ready(const ServerConfig& config) {
  const std::string pages =
      config.http.port == 0
          ? ""
          : fmt::format(", pages on http://{}:{}", config.http.address, config.http.port);
  const std::string serves =
      config.serves ? fmt::format("serves {} cells on {}:{}, domain {}", config.cells.size(),
                                  config.dds.address, config.dds.port, config.dds.domain)
                    : fmt::format("trains {} cells", config.cells.size());
  tell(LogLevel::kInfo, "ready",
       fmt::format("ready: {} {}, store {}{}", config.dds.server_id, serves,
                   spoken_place(config.store), pages));
  tell_manager_ready("serves");
}

/// Starts to answer. Returns the lock on the server's name. The server owns the name as long as it
/// holds the lock.
Result<PortLock> open_to_clients(const DdsOptions& options, DdsService& service) {
  // A second copy of this server gets the error about the port first.
  const Status free = PortLock::take(options.address, options.port).map([](const PortLock&) {});
  if (!free) return tl::make_unexpected(free.error());
  auto name = PortLock::take_name(options.domain, options.server_id);
  if (!name) return name;
  if (const Status started = service.start(); !started) return tl::make_unexpected(started.error());
  return name;
}

/// Reports how safe acknowledgements are, by the present state of the database.
void tell_record(const Store& store) {
  const RecordState record = store.record();
  if (record.kind != "postgresql" || record.survives.empty()) return;
  tell(record.worry.empty() ? LogLevel::kInfo : LogLevel::kWarn, "record",
       fmt::format("record: {}; an acknowledged change survives {}{}", record.place,
                   record.survives, record.worry.empty() ? "" : "; " + record.worry));
  if (const std::string missing = missing_watchdog(); !missing.empty())
    tell(LogLevel::kWarn, "watchdog", missing);
}

void hangs() {
  end_at_once("trammeld: hangs: was asked to stop and has not stopped after 10 s; ends at once\n");
}

void tell_in_force(const ServedModel& model) {
  const std::string& id = model.model.provenance().id;
  tell(LogLevel::kInfo, "model_in_force",
       fmt::format("{}: version {} ({}) is in force", model.cell, model.version, id),
       {{"cell", model.cell}, {"version", std::to_string(model.version)}, {"model", id}});
}

void stop(Store& store, DdsService& service, Trainer& trainer) {
  tell_manager_stopping();
  store.will_end();
  service.stop();
  trainer.stop();
  tell(LogLevel::kInfo, "stopped", "stopped");
}

/// Serves until a signal ends it.
Status serve(ServerConfig config, const Arguments& arguments) {
  CaughtSignals signals(hangs);  // before any thread of ours starts
  auto store = Store::open(config.store, config.cache);
  if (!store) return tl::make_unexpected(store.error());
  (*store)->works_as(config.dds.server_id);
  tell_record(**store);
  ModelRegistry registry(config.models_in_memory);
  Trainer trainer(config.cells, **store, registry, config.trainer);
  config.dds.local_calls = config.http.api && config.http.port != 0;
  DdsService service(config.dds, trainer, **store, registry);
  Gateway gateway(
      registry, [&service](const auto& work) { return service.with_calls(work); },
      config.dds.program_version);
  HttpServer http(config.http,
                  {config.dds.server_id, config.dds.program_version, spoken_place(config.store),
                   trainer, **store, registry, [&service] { return service.figures(); },
                   [&service] { return service.movement(); }},
                  gateway.api());
  TRY(http.start());
  service.set_call_listener(log_call);
  service.set_packet_listener(
      [](const char* event, const std::string& what) { tell(LogLevel::kWarn, event, what); });
  trainer.set_listeners(
      [&service, &http](const JobProgress& progress) {
        log_progress(progress);
        http.job_changed(progress);
        service.publish_progress(progress);
      },
      [&service](const ServedModel& model, bool in_force) {
        if (!in_force) return;
        tell_in_force(model);
        service.publish_model(model.cell);
      },
      [](const std::string& trouble, bool over) {
        if (over) return tell(LogLevel::kInfo, "trouble_over", "over: " + trouble);
        tell(LogLevel::kWarn, "trouble", trouble);
      });

  const auto notices = trainer.take_up();
  if (!notices) return tl::make_unexpected(notices.error());
  for (const std::string& notice : *notices) tell(LogLevel::kWarn, "notice", notice);
  std::optional<PortLock> name;
  if (config.serves) {
    auto taken = open_to_clients(config.dds, service);
    if (!taken) return tl::make_unexpected(taken.error());
    name.emplace(std::move(*taken));
  }
  if (const auto started = trainer.start(); !started) return tl::make_unexpected(started.error());
  http.set_phase(ServerPhase::kServing);
  tell_ready(config);

  const int ended_by = watch(signals, {config, arguments, service, trainer, registry});
  tell(LogLevel::kInfo, "stopping", fmt::format("stopping: {}", ::strsignal(ended_by)));
  http.set_phase(ServerPhase::kStopping);
  stop(**store, service, trainer);
  return {};
}

int run(const Arguments& arguments) {
  ServerReading server = read_server(arguments.config);
  ServerConfig& config = server.config;
  config.trainer.compute.program = {"/proc/self/exe",
                                    kComputeWord};  // this very program file, even if it was
                                                    // replaced on disk
  put_over(config, arguments);
  config.trainer.self =
      ServerSelf::here(config.dds.program_version, config.serves, config.trainer.trains);
  if (arguments.check)
    return check(server, arguments.config,
                 arguments.store ? StoreToCheck::kCopy : StoreToCheck::kOwn);
  if (!server.problems.empty()) return refuse_start(server.problems);
  if (auto log = start_log(config.log); !log) return refuse(log.error());
  const Status served = serve(config, arguments);
  if (served) return 0;
  if (!config.log.file.empty()) tell(LogLevel::kError, "start_refused", sentence(served.error()));
  return refuse(served.error());
}

}  // namespace
}  // namespace trammel

int main(int argc, char** argv) {
  if (argc > 1 && std::string_view(argv[1]) == trammel::kComputeWord)
    return trammel::compute_main({argv + 2, argv + argc});
  CLI::App app(
      "Serves compensated robot models over DDS, and trains new ones. Runs until SIGTERM or "
      "SIGINT.",
      "trammeld");
  app.footer(
      "Exit codes: 0 stopped by a signal, or checked and good; 1 checked, and cells would go dark; "
      "2 wrong usage, or\n"
      "an address that this host does not have; 3 a file, the store or the port is refused; 70 the "
      "process hung and\n"
      "ended itself (start it again: deploy/supervise does). Each problem is a line of its own on "
      "standard error.");
  trammel::Arguments arguments;
  app.set_version_flag("--version", trammel::DdsOptions().program_version);
  app.add_option("--config", arguments.config,
                 "Server file (YAML); config/server.yaml has every key with its default")
      ->required();
  app.add_flag("--check", arguments.check,
               "Only say all that a start or a first training would refuse, and change nothing");
  app.add_option("--store", arguments.store,
                 "Store (SQLite file, or URL of a PostgreSQL) instead of the server file's");
  app.add_option("--port", arguments.port,
                 "UDP port where clients look for it, instead of the server file's")
      ->check(CLI::Range(1024, 65535));
  app.add_option("--domain", arguments.domain, "DDS domain instead of the server file's")
      ->check(CLI::Range(0, 232));
  app.add_option("--http-port", arguments.http_port,
                 "TCP port for metrics and pages, instead of the server file's")
      ->check(CLI::Range(1024, 65535));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);
    fmt::print(stderr,
               "trammeld: {}; usage: trammeld --config SERVER.yaml [--check]; trammeld --help "
               "tells all options\n",
               trammel::shown(error.what()));
    return trammel::kExitUsage;
  }
  ::umask(0077);  // measurements, models and records are for the daemon's user only
  trammel::ignore_what_calls_report();
  trammel::give_large_blocks_back();
  return trammel::run(arguments);
}
