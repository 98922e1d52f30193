// The data that a session reads from servers: batches, jobs, models, findings.
#include <algorithm>
#include <functional>

#include "clients/session/participant.h"

namespace trammel::client {
namespace {

/// True if both entries are the same job: their servers have one record.
bool is_same(const wire::Job& a, const wire::Job& b) {
  return a.number() == b.number() && a.cell() == b.cell() && a.kind() == b.kind() &&
         a.created_unix_s() == b.created_unix_s() && a.batch_ids() == b.batch_ids();
}

/// Adds the items that no other server has listed already, since several servers have one record.
template <typename Item, typename IsSame>
void add_new(std::vector<std::pair<Item, std::string>>& all, const std::vector<Item>& told,
             const std::string& server, const IsSame& is_same) {
  const auto before = static_cast<std::ptrdiff_t>(all.size());  // a server sends each once
  for (const Item& item : told) {
    const auto known = [&](const auto& other) { return is_same(other.first, item); };
    if (std::none_of(all.begin(), all.begin() + before, known)) all.emplace_back(item, server);
  }
}

std::vector<BatchOfService> batches_in(const std::vector<wire::ReadModelsReply>& replies) {
  std::vector<std::pair<wire::BatchInfo, std::string>> told;
  for (const wire::ReadModelsReply& reply : replies)
    add_new(told, reply.batches(), reply.header().server().to_string(), std::equal_to<>());
  std::vector<BatchOfService> batches;
  for (const auto& [batch, server] : told) {
    batches.push_back(from_wire(batch));
    batches.back().server = server;
  }
  return batches;
}

}  // namespace

Result<DiagnosisAnswer> Session::diagnosis(const std::string& cell, std::int64_t job, bool page) {
  const auto found = TRY(participant_->find_job(job, cell));
  wire::ReadModelsRequest request;
  request.job(job);
  request.page(page);
  auto reply = TRY(participant_->read(cell, found.first, wire::READ_FINDINGS, std::move(request),
                                      participant_->record_of(found.first)));
  return DiagnosisAnswer{std::move(reply.text()), std::move(reply.page_html()),
                         from_wire(reply.in_force())};
}

Result<std::vector<BatchOfService>> Session::quarantine(const std::string& cell) {
  return participant_->read_all(cell, wire::READ_QUARANTINE).map(batches_in);
}

Result<std::vector<BatchOfService>> Session::batches(const std::string& cell) {
  return participant_->read_all(cell, wire::READ_BATCHES).map(batches_in);
}

Result<std::string> Session::export_batch(const std::string& cell, const std::string& batch_id) {
  wire::ReadModelsRequest request;
  request.batch_id(batch_id);
  auto reply = TRY(participant_->read(cell, {}, wire::READ_BATCH, request));
  return std::move(reply.text());
}

Result<std::vector<DatedJob>> Session::jobs(const std::string& cell) {
  const auto replies = TRY(participant_->read_all(cell, wire::READ_JOBS));
  std::vector<std::pair<wire::Job, std::string>> told;
  for (const wire::ReadModelsReply& reply : replies)
    add_new(told, reply.jobs(), reply.header().server().to_string(), is_same);
  // The server that works on a job knows its progress best.
  for (const wire::ReadModelsReply& reply : replies) {
    for (const wire::Job& job : reply.jobs()) {
      if (job.server() != reply.header().server().to_string()) continue;
      for (auto& [known, server] : told) {
        if (is_same(known, job)) known = job;
      }
    }
  }
  std::vector<DatedJob> jobs;
  for (const auto& [job, server] : told) jobs.push_back(from_wire(job, server));
  return jobs;
}

Result<std::vector<AuditText>> Session::audit(const std::string& cell, std::int64_t since_unix_s,
                                              std::size_t most) {
  wire::ReadModelsRequest request;
  request.since_unix_s(since_unix_s);
  request.most(static_cast<std::uint32_t>(most));
  const auto replies = TRY(participant_->read_all(cell, wire::READ_AUDIT, request));
  std::vector<AuditText> texts;
  for (const wire::ReadModelsReply& reply : replies)
    texts.push_back({reply.header().server().to_string(), reply.text()});
  return texts;
}

Result<std::vector<std::string>> Session::fleet() {
  const auto replies = TRY(participant_->read_all("", wire::READ_FLEET));
  std::vector<std::string> texts;
  for (const wire::ReadModelsReply& reply : replies) texts.push_back(reply.text());
  return texts;
}

Result<std::vector<std::string>> Session::health(const std::string& cell, std::size_t most) {
  wire::ReadModelsRequest request;
  request.since_unix_s(-1);
  request.most(static_cast<std::uint32_t>(most));
  const auto replies = TRY(participant_->read_all(cell, wire::READ_HEALTH, request));
  std::vector<std::string> texts;
  for (const wire::ReadModelsReply& reply : replies) texts.push_back(reply.text());
  return texts;
}

Result<std::vector<exchange::ModelInfo>> Session::models(const std::string& cell) {
  const auto reply = TRY(participant_->read(cell, {}, wire::READ_MODELS));
  std::vector<exchange::ModelInfo> models;
  for (const wire::ModelInfo& model : reply.models()) models.push_back(from_wire(model));
  return models;
}

Result<std::string> Session::export_model(const std::string& cell, int version) {
  wire::ReadModelsRequest request;
  request.version(version);
  auto reply = TRY(participant_->read(cell, {}, wire::READ_MODEL, std::move(request)));
  return std::move(reply.text());
}

Result<std::string> Session::replay(const std::string& cell, int version) {
  wire::ReadModelsRequest request;
  request.version(version);
  auto reply = TRY(participant_->read(cell, {}, wire::READ_REPLAY, std::move(request)));
  return std::move(reply.text());
}

}  // namespace trammel::client
