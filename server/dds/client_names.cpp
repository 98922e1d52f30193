#include "server/dds/client_names.h"

#include <fmt/format.h>

#include "idl/transport/security.h"
#include "server/base/plain_text.h"

namespace trammel {
namespace {

/// For the log, whatever a stranger writes: printable and short.
std::string claim_of(const std::string& name, const std::string& claimed,
                     const std::string& address) {
  constexpr std::size_t kLongest = 160;
  const std::string where = address.empty() ? "" : ", at " + shown_short(address);
  if (!name.empty()) return fmt::format("says it is {}{}", shown_short(name, kLongest), where);
  if (claimed.empty()) return "shows no certificate" + where;
  return fmt::format("says it is {}, which does not fit its GUID{}", shown_short(claimed, kLongest),
                     where);
}

}  // namespace

void ClientNames::announced(const std::string& participant, const std::string& claimed,
                            const std::string& address) {
  const std::string name = wire::confirmed_subject(claimed, participant);
  const MutexLock lock(mutex_);
  if (name.empty() && known_.size() >= kClaims && !known_.contains(participant)) return;
  Known& known = known_[participant];
  if (known.left) known = {};  // a participant that has left and returns counts as new
  if (!name.empty()) known.name = name;
  known.claim = claim_of(name, claimed, address);
}

void ClientNames::let_in(const std::string& participant) {
  const MutexLock lock(mutex_);
  Known& known = known_[participant];
  known.is_in = true;
  known.left.reset();
}

std::string ClientNames::refused(const std::string& participant) {
  const MutexLock lock(mutex_);
  const auto found = known_.find(participant);
  if (found == known_.end()) return "says nothing of itself";
  found->second.is_in = false;
  return found->second.claim.empty() ? "says nothing of itself" : found->second.claim;
}

void ClientNames::called(const std::string& participant, const std::string& name) {
  const MutexLock lock(mutex_);
  known_[participant] = {name, {}, true, {}};
}

void ClientNames::left(const std::string& participant, Time now) {
  const MutexLock lock(mutex_);
  std::erase_if(known_,
                [&](const auto& one) { return one.second.left && now - *one.second.left > kKept; });
  const auto found = known_.find(participant);
  if (found == known_.end()) return;
  if (found->second.is_in) {
    found->second.left = now;
  } else {
    known_.erase(found);
  }
}

std::string ClientNames::of(const std::string& participant) const {
  const MutexLock lock(mutex_);
  const auto found = known_.find(participant);
  return found != known_.end() && found->second.is_in ? found->second.name : std::string();
}

}  // namespace trammel
