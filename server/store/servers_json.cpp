#include "server/store/servers_json.h"

#include <utility>

namespace trammel {
namespace {

using nlohmann::ordered_json;

ordered_json cells_json(const std::map<std::string, CellAtServer>& cells) {
  ordered_json list = ordered_json::array();
  for (const auto& [cell, at] : cells) {
    ordered_json one = {{"cell", cell}, {"version", at.version}};
    if (!at.why_not.empty()) one["why"] = at.why_not;
    list.push_back(std::move(one));
  }
  return list;
}

ordered_json jobs_json(const std::vector<JobAtServer>& jobs) {
  ordered_json list = ordered_json::array();
  for (const JobAtServer& one : jobs) list.push_back({{"job", one.job}, {"cell", one.cell}});
  return list;
}

}  // namespace

ordered_json servers_json(const std::vector<ServerInRecord>& servers) {
  ordered_json list = ordered_json::array();
  for (const ServerInRecord& one : servers) {
    list.push_back({{"server", one.self.server},
                    {"host", one.self.host},
                    {"pid", one.self.pid},
                    {"version", one.self.program},
                    {"serves", one.self.serves},
                    {"trains", one.self.trains},
                    {"since_unix_s", one.since},
                    {"heard_unix_s", one.heard_at},
                    {"silent_s", one.silent_s},
                    {"gone", one.is_gone},
                    {"changes_behind", one.behind},
                    {"works_on", jobs_json(one.works_on)},
                    {"cells", cells_json(one.self.cells)}});
  }
  return list;
}

ordered_json record_json(const RecordState& record) {
  ordered_json json = {{"kind", record.kind},           {"place", record.place},
                       {"reachable", record.reachable}, {"away_since_unix_s", nullptr},
                       {"trail_is_safe", nullptr},      {"survives", record.survives}};
  if (record.trail_is_safe) json["trail_is_safe"] = *record.trail_is_safe;
  if (record.away_since) json["away_since_unix_s"] = *record.away_since;
  return json;
}

}  // namespace trammel
