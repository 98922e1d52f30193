#include "server/tasks/train/train_sessions.h"

#include "server/measurement/sessions.h"

namespace trammel {

std::vector<LeftOutSession> leave_out_unplaced(BatchSplit& split) {
  std::vector<LeftOutSession> left_out;
  if (!has_sessions(split.train)) return left_out;
  std::vector<bool> kept;
  for (const MeasurementBatch& session : by_session(split.train)) {
    const std::string why = why_not_placed(session);
    kept.push_back(why.empty());
    if (!why.empty()) left_out.push_back({session.id, why});
  }
  if (left_out.empty() || left_out.size() == kept.size()) return left_out;
  split = {only_sessions(split.train, kept), only_sessions(split.validation, kept)};
  return left_out;
}

}  // namespace trammel
