#include "server/store/audit_json.h"

#include <utility>

#include "server/base/json_guard.h"

namespace trammel {
namespace {

using nlohmann::ordered_json;

ordered_json row_json(const AuditRow& row) {
  return {{"number", row.number},   {"at_unix_s", row.at},    {"who", row.who},
          {"server", row.server},   {"cell", row.cell},       {"what", row.what},
          {"subject", row.subject}, {"before", row.before},   {"after", row.after},
          {"why", row.why},         {"request", row.request}, {"hash_before", row.hash_before},
          {"hash", row.hash}};
}

AuditRow row_of(const nlohmann::json& json) {
  const auto text = [&json](const char* key) { return json.at(key).get<std::string>(); };
  AuditRow row{json.at("number"),
               json.at("at_unix_s"),
               text("who"),
               text("cell"),
               text("what"),
               text("subject"),
               text("before"),
               text("after"),
               text("why"),
               text("request"),
               text("hash_before"),
               text("hash"),
               json.value("server", "")};
  return row;
}

}  // namespace

ordered_json audit_json(const AuditTrail& trail) {
  ordered_json rows = ordered_json::array();
  for (const AuditRow& row : trail.rows) rows.push_back(row_json(row));
  ordered_json broken = nullptr;
  if (trail.broken)
    broken = {{"row", trail.broken->row.value_or(0)}, {"why", sentence(*trail.broken)}};
  return {{"verified", trail.verified}, {"broken", std::move(broken)}, {"rows", std::move(rows)}};
}

Result<AuditTrail> audit_of_json(const std::string& text) {
  try {
    const auto json = nlohmann::json::parse(text);
    AuditTrail trail;
    trail.verified = json.at("verified");
    for (const auto& row : json.at("rows")) trail.rows.push_back(row_of(row));
    if (const auto& broken = json.at("broken"); !broken.is_null()) {
      Failure error = failure(ErrorCode::kInternal, "{}", broken.at("why").get<std::string>());
      error.value().row = broken.at("row").get<long>();
      trail.broken = std::move(error.value());
    }
    return trail;
  } catch (const nlohmann::json::exception& error) {
    return failure(ErrorCode::kInternal, "the audit trail is not what a service sends: {}",
                   error.what());
  }
}

}  // namespace trammel
