#include "server/dds/replicas/batch_copies.h"

#include <algorithm>

namespace trammel {

std::map<std::string, std::uint64_t> BatchCopies::expect(const std::vector<std::string>& followers) {
  const MutexLock lock(mutex_);
  std::map<std::string, std::uint64_t> numbers;
  for (const std::string& follower : followers) {
    numbers[follower] = ++last_;
    waiting_[last_].from = follower;
  }
  return numbers;
}

void BatchCopies::answered(const std::string& follower, std::uint64_t number, const Status& outcome) {
  {
    const MutexLock lock(mutex_);
    const auto found = waiting_.find(number);
    if (found != waiting_.end() && found->second.from == follower) found->second.outcome = outcome;
  }
  changed_.notify_all();
}

std::map<std::string, Error> BatchCopies::wait(const std::map<std::string, std::uint64_t>& numbers, Time until) {
  MutexLock lock(mutex_);
  changed_.wait_until(lock, until, [&]() TRAMMEL_REQUIRES(mutex_) {
    return std::all_of(numbers.begin(), numbers.end(), [&](const auto& entry) TRAMMEL_REQUIRES(mutex_) {
      return waiting_.at(entry.second).outcome.has_value();
    });
  });
  std::map<std::string, Error> wrong;
  for (const auto& [follower, number] : numbers) {
    const std::optional<Status> outcome = waiting_.at(number).outcome;
    waiting_.erase(number);
    if (!outcome) {
      wrong[follower] = failure(ErrorCode::kUnreachable, "{} has not said that it has it", follower).value();
    } else if (!*outcome) {
      wrong[follower] = outcome->error();
    }
  }
  return wrong;
}

}  // namespace trammel
