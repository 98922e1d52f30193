#include "server/http/metrics.h"

#include "server/base/plain_text.h"
#include "server/base/unix_time.h"
#include "server/http/metric_families.h"
#include "server/http/process_figures.h"
#include "server/http/readiness.h"

namespace trammel {
namespace {

constexpr int kMostAsked = 5;              // cells that the store is asked about in one scrape
constexpr std::size_t kLongestPhase = 40;  // bytes

double number(std::uint64_t count) { return static_cast<double>(count); }

void add_process(MetricFamilies& out) {
  const ProcessFigures now = process_figures();
  out.counter("process_cpu_seconds_total", "Processor time.", now.processor_s);
  out.gauge("process_resident_memory_bytes", "Memory that is in use.", now.resident_bytes);
  out.gauge("process_threads", "Threads.", now.threads);
  out.gauge("process_open_fds", "Open files and sockets.", now.open_files);
  out.gauge("process_start_time_seconds", "Unix time of its start.", now.started);
}

void add_requests(MetricFamilies& out, const ServiceFigures& service) {
  for (const OperationFigures& one : service.operations) {
    out.histogram("trammel_request_seconds",
                  "From the arrival of a request that was worked on to its reply.",
                  LatencyHistogram::kBounds, one.latency.in_class, one.latency.sum,
                  {{"operation", one.operation}});
  }
  for (const OperationFigures& one : service.operations) {
    for (const auto& [result, count] : one.by_result) {
      out.counter("trammel_requests_total",
                  "Answers by their result; busy and deadline_missed were shed.", number(count),
                  {{"operation", one.operation}, {"result", result}});
    }
  }
  for (const QueueFigures& one : service.queues) {
    out.gauge("trammel_requests_waiting", "Requests that wait or are worked on.",
              number(one.requests), {{"queue", one.queue}});
  }
  out.gauge("trammel_requests_waiting_bytes", "Memory that these take.",
            number(service.waiting_bytes));
  out.gauge("trammel_clients", "Clients with a reply channel.", number(service.clients));
  out.counter("trammel_replies_unheard_total", "Replies that nobody listened to any more.",
              number(service.unheard));
  out.counter("trammel_participants_refused_total",
              "Participants without the right certificate or permissions, each try.",
              number(service.strangers));
  out.counter("trammel_requests_misdirected_total",
              "Requests whose reply would have gone to another client.",
              number(service.misdirected));
  out.counter("trammel_requests_unreadable_total",
              "Requests of which not even the header could be read.", number(service.unreadable));
  out.counter("trammel_samples_lost_total", "Requests that DDS lost before anybody saw them.",
              number(service.lost));
  for (const auto& [reason, count] : service.dropped_packets) {
    out.counter("trammel_packets_dropped_total", "Packets that were dropped unread.", number(count),
                {{"reason", reason}});
  }
}

void add_work(MetricFamilies& out, const std::map<std::string, WorkFigures>& work) {
  constexpr const char* kHelp =
      "Poses that were asked for, by whether the model knows the arm there.";
  for (const auto& [cell, of] : work) {
    out.counter("trammel_poses_asked_total", kHelp, number(of.inside),
                {{"cell", cell}, {"domain", "inside"}});
    out.counter("trammel_poses_asked_total", kHelp, number(of.outside),
                {{"cell", cell}, {"domain", "outside"}});
  }
  for (const auto& [cell, of] : work) {
    out.counter("trammel_targets_left_total", "Targets that were left as they were.",
                number(of.left), {{"cell", cell}});
  }
  for (const auto& [cell, of] : work) {
    out.histogram("trammel_promised_stddev_mm",
                  "Standard deviation of the true error that the answers promised.",
                  WorkFigures::kBounds, of.in_class, of.sum_mm, {{"cell", cell}});
  }
}

/// `geometry, iteration 4` without its changing numbers, since each value makes a series of its
/// own.
std::string phase_of(const JobProgress& job) {
  const std::string phase = job.what.substr(0, job.what.find_first_of(",0123456789:"));
  const auto last = phase.find_last_not_of(' ');
  return shown_short(phase.substr(0, last == std::string::npos ? 0 : last + 1), kLongestPhase);
}

void add_jobs(MetricFamilies& out, const std::vector<JobProgress>& unfinished,
              const std::map<std::string, std::uint64_t>& ended) {
  std::map<JobStage, int> in_stage = {
      {JobStage::kQueued, 0}, {JobStage::kTraining, 0}, {JobStage::kStoring, 0}};
  for (const JobProgress& job : unfinished) ++in_stage[job.stage];
  const auto state = [&](const char* name, JobStage stage) {
    out.gauge("trammel_jobs", "Trainings, diagnoses and checks that are not over.", in_stage[stage],
              {{"state", name}});
  };
  state("queued", JobStage::kQueued);
  state("computing", JobStage::kTraining);
  state("storing", JobStage::kStoring);
  for (const JobProgress& job : unfinished) {
    if (job.stage != JobStage::kTraining) continue;
    out.gauge("trammel_job_progress_ratio", "How much of the running job is done.", job.share,
              {{"cell", job.cell}, {"phase", phase_of(job)}});
  }
  for (const auto& [verdict, count] : ended) {
    out.counter("trammel_jobs_ended_total", "Jobs that ended since the start, by their outcome.",
                number(count), {{"verdict", verdict}});
  }
}

void add_store(MetricFamilies& out, const Watched& server) {
  const StoreState state = server.store.state();
  if (!server.store.is_shared()) {  // a database has its host, and figures of its own
    const StoreFileFigures file = store_file_figures(server.store_path);
    out.gauge("trammel_store_bytes", "Size of the store.", file.bytes);
    out.gauge("trammel_store_journal_bytes", "Size of its write-ahead log.", file.journal_bytes);
    out.gauge("trammel_store_free_bytes", "Room on its disk.", file.free_bytes);
  }
  out.gauge("trammel_store_writable", "1: changes can be stored.", state.why_not_written ? 0 : 1);
  out.counter("trammel_store_failed_writes_total", "Changes that the disk did not take.",
              number(state.failed_writes));
  out.gauge("trammel_troubles", "What is wrong now, as the status says it.",
            number(server.trainer.troubles().size()));
}

/// As the servers were heard of last. While the record is away nobody knows who is there.
void add_record(MetricFamilies& out, const Watched& server) {
  const StoreState state = server.store.state();
  const bool reachable = !state.why_not_written;
  out.gauge("trammel_record_reachable", "1: the store can be read and written.", reachable ? 1 : 0);
  out.gauge("trammel_record_away_seconds", "For how long it has not been; 0: it is reachable.",
            reachable ? 0 : static_cast<double>(unix_now() - state.since));
  if (!reachable) return;
  const std::vector<ServerInRecord> servers = server.trainer.servers_seen();
  const auto each = [&](const char* name, const char* help, const auto& value) {
    for (const ServerInRecord& one : servers)
      out.gauge(name, help, value(one), {{"name", one.self.server}, {"host", one.self.host}});
  };
  each("trammel_server_there", "1: the server of the record is there; 0: it went without a word.",
       [](const ServerInRecord& one) { return one.is_gone ? 0.0 : 1.0; });
  each("trammel_server_changes_behind", "Changes of the record that the server has not taken up.",
       [](const ServerInRecord& one) { return static_cast<double>(one.behind); });
  each("trammel_server_jobs", "Jobs that the server works on.",
       [](const ServerInRecord& one) { return static_cast<double>(one.works_on.size()); });
}

void add_models_in_memory(MetricFamilies& out, const ModelRegistry& registry) {
  out.gauge("trammel_models_in_memory_bytes", "Memory of the models that are loaded.",
            number(registry.bytes()));
  out.gauge("trammel_cells_with_a_model", "Cells with a model in force.",
            number(registry.cells_served()));
}

}  // namespace

void Metrics::job_changed(const JobProgress& job) {
  if (job.stage != JobStage::kDone && job.stage != JobStage::kFailed) return;
  const MutexLock lock(mutex_);
  ++ended_[to_text(job.outcome.verdict)];
}

std::map<std::string, Metrics::Stamp> Metrics::stamps() {
  const auto places = server_.registry.places();
  const auto in_memory = server_.registry.all();
  const MutexLock lock(mutex_);
  for (const ServedModelPtr& model : in_memory) {
    const ModelProvenance& made = model->model.provenance();
    stamps_[model->cell] = {model->version, made.trained_at, made.measured_at};
  }
  int asked = 0;
  for (const auto& [cell, place] : places) {
    if (stamps_[cell].version == place.version || ++asked > kMostAsked) continue;
    for (const StoredModel& model :
         server_.store.models(cell).value_or(std::vector<StoredModel>())) {
      if (model.version == place.version)
        stamps_[cell] = {model.version, model.trained_at, model.measured_at};
    }
  }
  std::erase_if(stamps_, [&](const auto& one) { return !places.contains(one.first); });
  return stamps_;
}

std::string Metrics::text(ServerPhase phase, std::uint64_t shed) {
  MetricFamilies out;
  out.gauge("trammel_build_info", "1; the labels say what runs.", 1,
            {{"version", server_.program_version}, {"server", server_.server_id}});
  add_process(out);
  out.counter("trammel_http_shed_total", "Requests for pages that were sent away.", number(shed));
  out.gauge("trammel_serving", "1: it is neither starting nor stopping.",
            phase == ServerPhase::kServing ? 1 : 0);
  if (phase != ServerPhase::kServing) return out.text();
  out.gauge("trammel_healthy", "1: every part of it moves.",
            server_.movement().still.empty() ? 1 : 0);
  const ServiceFigures service = server_.figures();
  add_requests(out, service);
  add_work(out, service.work);
  if (service.not_recorded)
    out.counter("trammel_requests_not_recorded_total",
                "Requests that are in no record: the disk was too slow or full.",
                number(*service.not_recorded));
  std::map<std::string, std::uint64_t> ended;
  {
    const MutexLock lock(mutex_);
    ended = ended_;
  }
  add_jobs(out, server_.trainer.unfinished_jobs(), ended);
  add_store(out, server_);
  add_record(out, server_);
  add_models_in_memory(out, server_.registry);
  for (const CellReadiness& one : cells_readiness(server_)) {
    out.gauge("trammel_cell_ready", "1: the cell is answered for.", one.is_dark() ? 0 : 1,
              {{"cell", one.cell}, {"state", to_text(one.state)}});
  }
  const double now = static_cast<double>(unix_now());
  for (const auto& [cell, stamp] : stamps()) {
    if (stamp.version == 0) continue;
    out.gauge("trammel_model_version", "Version in force.", stamp.version, {{"cell", cell}});
    out.gauge("trammel_model_training_age_seconds", "Since the model in force was trained.",
              now - static_cast<double>(stamp.trained_at), {{"cell", cell}});
    if (!stamp.measured_at) continue;
    out.gauge("trammel_model_data_age_seconds",
              "Since the newest measurement that it was made from.",
              now - static_cast<double>(*stamp.measured_at), {{"cell", cell}});
  }
  return out.text();
}

}  // namespace trammel
