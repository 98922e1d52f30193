#include "server/dds/client_names.h"

#include "idl/security.h"

namespace trammel {

void ClientNames::announced(const std::string& participant, const std::string& claimed) {
  const std::string name = wire::confirmed_subject(claimed, participant);
  if (name.empty()) return;
  const MutexLock lock(mutex_);
  Known& known = known_[participant];
  if (known.left) known = {};  // it is new, and is let in anew
  known.name = name;
}

void ClientNames::let_in(const std::string& participant) {
  const MutexLock lock(mutex_);
  Known& known = known_[participant];
  known.is_in = true;
  known.left.reset();
}

void ClientNames::refused(const std::string& participant) {
  const MutexLock lock(mutex_);
  const auto found = known_.find(participant);
  if (found != known_.end()) found->second.is_in = false;
}

void ClientNames::left(const std::string& participant, Time now) {
  const MutexLock lock(mutex_);
  std::erase_if(known_, [&](const auto& one) { return one.second.left && now - *one.second.left > kKept; });
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
