#include "server/registry/model_registry.h"

#include <algorithm>
#include <chrono>
#include <exception>

#include "server/base/check.h"
#include "server/bias/choose_bias.h"
#include "server/compensate/model_notes.h"

namespace trammel {
namespace {

constexpr std::size_t kRest = 256 * 1024;      // bytes of a model that do not grow with its poses
constexpr std::size_t kOfAPose = 2 * 1024;     // bytes of one pose besides the variances
constexpr std::size_t kMostOfAnExpert = 1200;  // poses

/// The largest memory of a bias at the flange: one matrix of all its numbers.
std::size_t bytes_at_flange(std::size_t poses) {
  const std::size_t numbers = std::min(3 * poses, static_cast<std::size_t>(kMostFlangeNumbers));
  return numbers * numbers * sizeof(double);
}

}  // namespace

std::size_t bytes_of(const CompensatedModel& model) {
  if (!model.bias()) return kRest;
  const auto poses = static_cast<std::size_t>(model.bias()->state().q.rows());
  if (model.bias()->needs_features() && !model.bias()->has_blocks())
    return kRest + poses * kOfAPose + bytes_at_flange(poses) +
           3 * poses * std::min(poses, kMostOfAnExpert) * 4;
  const std::size_t outputs = model.parts().rotation_bias ? 6 : 3;
  const std::size_t triangle = poses * std::min(poses, kMostOfAnExpert) / 2 * sizeof(double);
  const std::size_t triangles = outputs * (model.bias()->needs_features() ? 2 : 1);
  return kRest + poses * kOfAPose + triangles * triangle;
}

const int* ModelRegistry::place_of(const std::string& cell) const {
  const auto found = in_force_.find(cell);
  return found == in_force_.end() ? nullptr : &found->second;
}

ServedModelPtr ModelRegistry::held(const Key& key) const {
  const auto found = held_.find(key);
  if (found == held_.end()) return nullptr;
  found->second.used = ++uses_;
  return found->second.model;
}

void ModelRegistry::hold(ServedModelPtr model, std::vector<ServedModelPtr>* left) const {
  const Key key(model->cell, model->version);
  Held& place = held_[key];
  if (place.model) left->push_back(std::move(place.model));
  bytes_ -= place.bytes;
  place = {std::move(model), 0, ++uses_};
  place.bytes = bytes_of(place.model->model);
  bytes_ += place.bytes;
  while (bytes_ > budget_ && held_.size() > 1) {
    const auto oldest =
        std::min_element(held_.begin(), held_.end(), [&key](const auto& a, const auto& b) {
          if ((a.first == key) != (b.first == key)) return b.first == key;
          return a.second.used < b.second.used;
        });
    bytes_ -= oldest->second.bytes;
    left->push_back(std::move(oldest->second.model));
    held_.erase(oldest);
  }
}

ServedModelPtr ModelRegistry::in_force(const std::string& cell) const {
  for (;;) {
    Key key;
    {
      const MutexLock lock(mutex_);
      const int* version = place_of(cell);
      if (version == nullptr) return nullptr;
      key = {cell, *version};
      if (auto model = held(key)) return model;
    }
    // If it fails, the cell has another model in force by now, or none.
    if (const auto loaded = load(key); loaded && *loaded) return *loaded;
  }
}

int ModelRegistry::version_in_force(const std::string& cell) const {
  const MutexLock lock(mutex_);
  const int* version = place_of(cell);
  return version == nullptr ? 0 : *version;
}

Result<ServedModelPtr> ModelRegistry::version(const std::string& cell, int version) const {
  const Key key(cell, version);
  for (;;) {
    {
      const MutexLock lock(mutex_);
      if (auto model = held(key)) return model;
    }
    const auto loaded = load(key);
    if (!loaded) return loaded;
    if (*loaded && (*loaded)->version == version) return loaded;
    if (*loaded)
      return failure(ErrorCode::kInternal,
                     "cell {}: version {} cannot be loaded, version {} is served", cell, version,
                     (*loaded)->version);
  }
}

ModelRegistry::Ready ModelRegistry::ready(const std::string& cell) const {
  {
    const MutexLock lock(mutex_);
    const int* version = place_of(cell);
    if (version == nullptr) return {};
    const Key key(cell, *version);
    if (auto model = held(key)) return {std::move(model), false};
    if (is_loading_) {
      if (std::find(wanted_.begin(), wanted_.end(), key) == wanted_.end()) wanted_.push_back(key);
      changed_.notify_all();
      return {nullptr, true};
    }
  }
  return {in_force(cell), false};
}

void ModelRegistry::publish(ServedModelPtr model) {
  TRAMMEL_CHECK(model != nullptr);
  std::vector<ServedModelPtr> left;  // freed after the lock
  const MutexLock lock(mutex_);
  in_force_[model->cell] = model->version;
  never_loaded_.erase(model->cell);
  hold(std::move(model), &left);
}

void ModelRegistry::announce(const std::string& cell, int version) {
  const MutexLock lock(mutex_);
  in_force_[cell] = version;
  if (held_.contains({cell, version})) return;
  never_loaded_.insert(cell);
  changed_.notify_all();
}

std::vector<ServedModelPtr> ModelRegistry::all() const {
  const MutexLock lock(mutex_);
  std::vector<ServedModelPtr> models;
  for (const auto& [cell, version] : in_force_) {
    const auto found = held_.find({cell, version});
    if (found != held_.end()) models.push_back(found->second.model);
  }
  return models;
}

std::map<std::string, ModelRegistry::Place> ModelRegistry::places() const {
  const MutexLock lock(mutex_);
  std::map<std::string, Place> places;
  for (const auto& [cell, version] : in_force_) {
    const bool comes = has_room() && never_loaded_.contains(cell);
    const auto elsewhere = comes ? Place::Where::kComes : Place::Where::kOnDisk;
    places[cell] = {version, held_.contains({cell, version}) ? Place::Where::kInMemory : elsewhere};
  }
  return places;
}

std::size_t ModelRegistry::cells_served() const {
  const MutexLock lock(mutex_);
  return in_force_.size();
}

std::size_t ModelRegistry::bytes() const {
  const MutexLock lock(mutex_);
  return bytes_;
}

void ModelRegistry::set_source(ModelSource source) {
  const MutexLock lock(mutex_);
  source_ = std::move(source);
}

Result<ServedModelPtr> ModelRegistry::load(const Key& key) const {
  bool in_force = false;
  bool first = false;
  {
    MutexLock lock(mutex_);
    if (loading_.contains(key)) {
      changed_.wait(lock, [&]() TRAMMEL_REQUIRES(mutex_) { return !loading_.contains(key); });
      return ServedModelPtr();
    }
    if (held_.contains(key)) return ServedModelPtr();
    const int* version = place_of(key.first);
    in_force = version != nullptr && *version == key.second;
    first = in_force && never_loaded_.contains(key.first);
    loading_.insert(key);
  }
  const auto loaded = from_source(key, in_force);
  std::vector<ServedModelPtr> left;
  {
    const MutexLock lock(mutex_);
    loading_.erase(key);
    settle(key, in_force, loaded);
    if (loaded) hold(*loaded, &left);
  }
  changed_.notify_all();
  if (loaded && first) {
    std::function<void(const ServedModelPtr&)> tell;
    {
      const MutexLock lock(mutex_);
      tell = source_.loaded;
    }
    if (tell) tell(*loaded);
  }
  return loaded;
}

Result<ServedModelPtr> ModelRegistry::from_source(const Key& key, bool in_force) const {
  ModelSource source;
  {
    const MutexLock lock(mutex_);
    source = source_;
  }
  if (!source.in_force || !source.version)
    return failure(ErrorCode::kNotFound, "cell {}: version {} is not in memory", key.first,
                   key.second);
  try {
    auto model = TRY(in_force ? source.in_force(key.first) : source.version(key.first, key.second));
    return reclaimed(std::move(model));
  } catch (const std::exception& error) {  // out of memory, for one
    return failure(ErrorCode::kInternal, "cell {}: version {} cannot be loaded: {}", key.first,
                   key.second, error.what());
  }
}

void ModelRegistry::settle(const Key& key, bool in_force,
                           const Result<ServedModelPtr>& loaded) const {
  const int* now = place_of(key.first);
  if (!in_force || now == nullptr || *now != key.second)
    return;  // something else went in force meanwhile
  never_loaded_.erase(key.first);
  if (loaded) {
    in_force_[key.first] = (*loaded)->version;
  } else {
    in_force_.erase(key.first);
  }
}

std::optional<ModelRegistry::Key> ModelRegistry::next_to_load() const {
  if (!wanted_.empty()) {
    Key key = wanted_.front();
    wanted_.pop_front();
    return key;
  }
  if (never_loaded_.empty() || !has_room()) return std::nullopt;
  const std::string& cell = *never_loaded_.begin();
  return Key(cell, in_force_.at(cell));
}

void ModelRegistry::load_for(const std::stop_token& stop, std::chrono::milliseconds tick) {
  const auto until = std::chrono::steady_clock::now() + tick;
  const auto go_on = [&] {
    return !stop.stop_requested() && std::chrono::steady_clock::now() < until;
  };
  while (go_on()) {
    std::optional<Key> key;
    {
      MutexLock lock(mutex_);
      is_loading_ = true;
      changed_.wait_until(lock, stop, until, [&]() TRAMMEL_REQUIRES(mutex_) {
        key = next_to_load();
        return key.has_value();
      });
    }
    // The result goes to the registry, where the requesters find it.
    if (key) static_cast<void>(load(*key));
  }
}

void ModelRegistry::stop_loading() {
  const MutexLock lock(mutex_);
  is_loading_ = false;
}

}  // namespace trammel
