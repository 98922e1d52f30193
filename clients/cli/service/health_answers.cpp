#include "clients/cli/service/health_answers.h"

#include <algorithm>
#include <utility>

#include "server/base/json_guard.h"

namespace trammel::cli {

namespace {

using nlohmann::ordered_json;

Result<ordered_json> answer_in(const std::string& text) {
  TRY(check_json_limits(text, "the health of cells"));
  ordered_json json = ordered_json::parse(text, nullptr, false);
  if (!json.is_object() || !json.contains("cells") || !json["cells"].is_array())
    return failure(ErrorCode::kInternal,
                   "what the service says of the health of cells has no cells");
  for (const auto& one : json["cells"])
    if (!one.is_object()) return failure(ErrorCode::kInternal, "the health of a cell is no object");
  return json;
}

}  // namespace

Result<std::vector<ordered_json>> health_answers(client::Session& session, const std::string& cell,
                                                 std::size_t most) {
  const auto texts = TRY(session.health(cell, most));
  std::vector<ordered_json> answers;
  for (const std::string& text : texts) {
    auto answer = TRY(answer_in(text));
    answers.push_back(std::move(answer));
  }
  return answers;
}

std::vector<ordered_json> cells_of(const std::vector<ordered_json>& answers) {
  std::vector<ordered_json> cells;
  for (const ordered_json& answer : answers) {
    for (const ordered_json& cell : answer["cells"])
      if (std::find(cells.begin(), cells.end(), cell) == cells.end()) cells.push_back(cell);
  }
  return cells;
}

Result<std::vector<ordered_json>> health_at(client::Session& session, const std::string& cell,
                                            std::size_t most) {
  return health_answers(session, cell, most).map(cells_of);
}

}  // namespace trammel::cli
