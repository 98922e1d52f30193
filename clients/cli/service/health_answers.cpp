#include "clients/cli/service/health_answers.h"

#include "server/base/json_guard.h"

namespace trammel::cli {

Result<std::vector<nlohmann::ordered_json>> health_at(client::Session& session, const std::string& cell,
                                                      std::size_t most) {
  const auto texts = session.health(cell, most);
  if (!texts) return tl::make_unexpected(texts.error());
  std::vector<nlohmann::ordered_json> cells;
  for (const std::string& text : *texts) {
    if (const Status small = check_json_limits(text, "the health of cells"); !small)
      return tl::make_unexpected(small.error());
    const auto json = nlohmann::ordered_json::parse(text, nullptr, false);
    if (!json.is_object() || !json.contains("cells") || !json["cells"].is_array())
      return failure(ErrorCode::kInternal, "what the service says of the health of cells has no cells");
    for (const auto& one : json["cells"]) {
      if (!one.is_object()) return failure(ErrorCode::kInternal, "the health of a cell is no object");
      cells.push_back(one);
    }
  }
  return cells;
}

}  // namespace trammel::cli
