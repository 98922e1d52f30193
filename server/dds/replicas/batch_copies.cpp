#include "server/dds/replicas/batch_copies.h"

#include <algorithm>
#include <functional>

namespace trammel {

bool passes(const Error& refusal) {
  return refusal.code == ErrorCode::kUnreachable || refusal.code == ErrorCode::kBusy ||
         refusal.code == ErrorCode::kInternal;
}

BatchCopies::Lacks BatchCopies::lacks(const Key& key, const std::string& standing) const {
  const MutexLock lock(mutex_);
  const auto found = told_.find(key);
  if (found == told_.end()) return Lacks::kText;
  const Told& told = found->second;
  const bool refused_for_now = told.outcome && !*told.outcome && passes(told.outcome->error());
  const bool is_known = told.standing == std::hash<std::string>()(standing);
  if (is_known && !told.overdue && !refused_for_now) return Lacks::kNothing;
  return told.has_text ? Lacks::kStanding : Lacks::kText;
}

std::uint64_t BatchCopies::tell(const Key& key, const std::string& standing) {
  const MutexLock lock(mutex_);
  Told& told = told_[key];
  unanswered_.erase(told.number);
  told = {++last_, std::hash<std::string>()(standing), told.has_text, false, std::nullopt};
  unanswered_[last_] = key;
  return last_;
}

void BatchCopies::answered(const std::string& participant, std::uint64_t number, const Status& outcome) {
  {
    const MutexLock lock(mutex_);
    const auto found = unanswered_.find(number);
    if (found == unanswered_.end() || found->second.participant != participant) return;
    Told& told = told_.at(found->second);
    unanswered_.erase(found);
    told.overdue = false;
    told.outcome = outcome;
    const bool has_lost_it = told.has_text && !outcome && outcome.error().code == ErrorCode::kNotFound;
    // Its store was put back to an older state: the text goes there once more.
    if (has_lost_it) told.outcome = failure(ErrorCode::kInternal, "{}", outcome.error().message);
    told.has_text = outcome || (told.has_text && !has_lost_it);
  }
  changed_.notify_all();
}

std::map<std::string, Error> BatchCopies::wait(const std::map<std::string, Key>& told, Time until) {
  MutexLock lock(mutex_);
  const auto all_answered = [&]() TRAMMEL_REQUIRES(mutex_) {
    return std::all_of(told.begin(), told.end(), [this](const auto& one) TRAMMEL_REQUIRES(mutex_) {
      const auto found = told_.find(one.second);
      return found == told_.end() || found->second.outcome;
    });
  };
  changed_.wait_until(lock, until, [&]() TRAMMEL_REQUIRES(mutex_) { return closing_ || all_answered(); });
  if (closing_) changed_.wait_until(lock, std::min(until, *closing_), all_answered);
  std::map<std::string, Error> wrong;
  for (const auto& [follower, key] : told) {
    const auto found = told_.find(key);
    if (found != told_.end() && found->second.outcome) {
      if (!*found->second.outcome) wrong[follower] = found->second.outcome->error();
      continue;
    }
    if (found != told_.end()) found->second.overdue = true;
    wrong[follower] = failure(ErrorCode::kUnreachable, "{} has not said that it has it", follower).value();
  }
  return wrong;
}

void BatchCopies::close(Time until) {
  {
    const MutexLock lock(mutex_);
    closing_ = until;
  }
  changed_.notify_all();
}

void BatchCopies::doubt(const std::string& participant) {
  const MutexLock lock(mutex_);
  for (auto& [key, told] : told_) {
    if (participant.empty() || key.participant == participant) told.standing.reset();
  }
}

void BatchCopies::forget_all_but(const std::set<std::string>& participants) {
  const MutexLock lock(mutex_);
  const auto is_over = [&](const auto& entry) {
    return !participants.contains(entry.first.participant) && (entry.second.outcome || entry.second.overdue);
  };
  std::erase_if(unanswered_,
                [&](const auto& one) TRAMMEL_REQUIRES(mutex_) { return is_over(*told_.find(one.second)); });
  std::erase_if(told_, is_over);
}

}  // namespace trammel
