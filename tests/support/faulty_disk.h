#pragma once

#include <sqlite3.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <mutex>
#include <random>
#include <string>
#include <vector>

namespace trammel::test {

/// The disk as SQLite sees it during the object's life: every file of SQLite goes through it. It
/// refuses calls as instructed, and records writes, so that a power cut after any call can be
/// replayed.
class FaultyDisk {
 public:
  enum class Call { kOpen, kWrite, kSync, kTruncate, kDelete, kShared };
  struct Event {
    Call call;
    std::string file;  ///< without its folder
    sqlite3_int64 offset = 0;
    std::string bytes;
  };
  /// The result of each call, in order: SQLITE_OK, or the error with which it must fail.
  using Plan = std::function<int(Call call, const std::string& file)>;

  FaultyDisk() : real_(::sqlite3_vfs_find(nullptr)), vfs_(*real_) {
    vfs_.zName = "faulty";
    vfs_.szOsFile = static_cast<int>(sizeof(File)) + real_->szOsFile;
    vfs_.pNext = nullptr;
    vfs_.xOpen = &FaultyDisk::open;
    vfs_.xDelete = &FaultyDisk::remove;
    only_ = this;
    ::sqlite3_vfs_register(&vfs_, 1);
  }
  ~FaultyDisk() {
    ::sqlite3_vfs_unregister(&vfs_);
    ::sqlite3_vfs_register(real_, 1);
    only_ = nullptr;
  }
  FaultyDisk(const FaultyDisk&) = delete;
  FaultyDisk& operator=(const FaultyDisk&) = delete;

  void set_plan(Plan plan) {
    const std::lock_guard lock(mutex_);
    plan_ = std::move(plan);
  }
  /// Everything fails with `code` that would need room.
  void refuse_writing(int code) {
    set_plan([code](Call, const std::string&) { return code; });
  }
  void work_again() { set_plan(nullptr); }
  /// The number of calls.
  std::size_t calls() {
    const std::lock_guard lock(mutex_);
    return events_.size();
  }

  /// The content of the disk after a power cut behind the first `calls` calls. Each write that was
  /// not synchronised is complete, missing, or present in its first half, by `random`.
  template <typename Random>
  void cut_power(std::size_t calls, Random& random, const std::filesystem::path& folder) {
    std::map<std::string, Content> files;
    {
      const std::lock_guard lock(mutex_);
      for (std::size_t i = 0; i < calls; ++i) play(events_[i], &files);
    }
    for (auto& [name, content] : files) {
      for (const Event& event : content.pending) {
        const auto fate = std::uniform_int_distribution<int>(0, 2)(random);
        if (fate == 0) continue;
        apply(event, fate == 1 ? 1.0 : 0.5, &content.synced);
      }
      if (content.exists) std::ofstream(folder / name, std::ios::binary) << content.synced;
    }
  }

 private:
  struct File {
    sqlite3_file base;
    std::string* name;
    sqlite3_file* real() { return reinterpret_cast<sqlite3_file*>(this + 1); }
  };
  struct Content {
    bool exists = false;
    std::string synced;
    std::vector<Event> pending;
  };

  static void apply(const Event& event, double share, std::string* content) {
    if (event.call == Call::kTruncate) {
      content->resize(static_cast<std::size_t>(event.offset));
      return;
    }
    const auto size = static_cast<std::size_t>(share * static_cast<double>(event.bytes.size()));
    const auto offset = static_cast<std::size_t>(event.offset);
    if (content->size() < offset + size) content->resize(offset + size);
    content->replace(offset, size, event.bytes, 0, size);
  }
  static void play(const Event& event, std::map<std::string, Content>* files) {
    Content& file = (*files)[event.file];
    switch (event.call) {
      case Call::kOpen:
        file.exists = true;
        break;
      case Call::kDelete:
        file = {};
        break;
      case Call::kSync:
        for (const Event& pending : file.pending) apply(pending, 1, &file.synced);
        file.pending.clear();
        break;
      case Call::kWrite:
      case Call::kTruncate:
        file.pending.push_back(event);
        break;
      case Call::kShared:
        break;
    }
  }

  int happens(Event event) {
    const std::lock_guard lock(mutex_);
    const int outcome = plan_ ? plan_(event.call, event.file) : SQLITE_OK;
    if (outcome == SQLITE_OK) events_.push_back(std::move(event));
    return outcome;
  }
  static int open(sqlite3_vfs*, const char* name, sqlite3_file* file, int flags, int* out) {
    File* own = reinterpret_cast<File*>(file);
    own->base.pMethods = nullptr;
    own->name = nullptr;
    const std::string short_name =
        name == nullptr ? "" : std::filesystem::path(name).filename().string();
    if (name != nullptr && (flags & SQLITE_OPEN_CREATE) != 0 && !std::filesystem::exists(name)) {
      if (const int refused = only_->happens({Call::kOpen, short_name, 0, ""});
          refused != SQLITE_OK)
        return refused;
    }
    const int opened = only_->real_->xOpen(only_->real_, name, own->real(), flags, out);
    if (opened != SQLITE_OK) return opened;
    own->name = new std::string(short_name);
    own->base.pMethods = methods();
    return SQLITE_OK;
  }
  static int remove(sqlite3_vfs*, const char* name, int sync) {
    const std::string short_name = std::filesystem::path(name).filename().string();
    if (const int refused = only_->happens({Call::kDelete, short_name, 0, ""});
        refused != SQLITE_OK)
      return refused;
    return only_->real_->xDelete(only_->real_, name, sync);
  }
  static File* own(sqlite3_file* file) { return reinterpret_cast<File*>(file); }
  static sqlite3_file* real(sqlite3_file* file) { return own(file)->real(); }
  static const sqlite3_io_methods* methods() {
    static const sqlite3_io_methods all = [] {
      sqlite3_io_methods m{};
      m.iVersion = 2;
      m.xClose = [](sqlite3_file* f) {
        delete own(f)->name;
        return real(f)->pMethods->xClose(real(f));
      };
      m.xRead = [](sqlite3_file* f, void* to, int size, sqlite3_int64 at) {
        return real(f)->pMethods->xRead(real(f), to, size, at);
      };
      m.xWrite = [](sqlite3_file* f, const void* from, int size, sqlite3_int64 at) {
        const std::string bytes(static_cast<const char*>(from), static_cast<std::size_t>(size));
        const int refused = only_->happens({Call::kWrite, *own(f)->name, at, bytes});
        return refused != SQLITE_OK ? refused : real(f)->pMethods->xWrite(real(f), from, size, at);
      };
      m.xTruncate = [](sqlite3_file* f, sqlite3_int64 size) {
        const int refused = only_->happens({Call::kTruncate, *own(f)->name, size, ""});
        return refused != SQLITE_OK ? refused : real(f)->pMethods->xTruncate(real(f), size);
      };
      m.xSync = [](sqlite3_file* f, int flags) {
        const int refused = only_->happens({Call::kSync, *own(f)->name, 0, ""});
        return refused != SQLITE_OK ? refused : real(f)->pMethods->xSync(real(f), flags);
      };
      m.xFileSize = [](sqlite3_file* f, sqlite3_int64* size) {
        return real(f)->pMethods->xFileSize(real(f), size);
      };
      m.xLock = [](sqlite3_file* f, int how) { return real(f)->pMethods->xLock(real(f), how); };
      m.xUnlock = [](sqlite3_file* f, int how) { return real(f)->pMethods->xUnlock(real(f), how); };
      m.xCheckReservedLock = [](sqlite3_file* f, int* out) {
        return real(f)->pMethods->xCheckReservedLock(real(f), out);
      };
      m.xFileControl = [](sqlite3_file* f, int what, void* with) {
        return real(f)->pMethods->xFileControl(real(f), what, with);
      };
      m.xSectorSize = [](sqlite3_file* f) { return real(f)->pMethods->xSectorSize(real(f)); };
      m.xDeviceCharacteristics = [](sqlite3_file* f) {
        return real(f)->pMethods->xDeviceCharacteristics(real(f));
      };
      m.xShmMap = [](sqlite3_file* f, int page, int size, int extend, void volatile** at) {
        if (extend != 0) {
          const int refused = only_->happens({Call::kShared, *own(f)->name, 0, ""});
          if (refused != SQLITE_OK) return refused;
        }
        return real(f)->pMethods->xShmMap(real(f), page, size, extend, at);
      };
      m.xShmLock = [](sqlite3_file* f, int at, int count, int how) {
        return real(f)->pMethods->xShmLock(real(f), at, count, how);
      };
      m.xShmBarrier = [](sqlite3_file* f) { real(f)->pMethods->xShmBarrier(real(f)); };
      m.xShmUnmap = [](sqlite3_file* f, int remove) {
        return real(f)->pMethods->xShmUnmap(real(f), remove);
      };
      return m;
    }();
    return &all;
  }

  static inline FaultyDisk* only_ = nullptr;
  sqlite3_vfs* real_;
  sqlite3_vfs vfs_;
  std::mutex mutex_;
  Plan plan_;                  // guarded by mutex_
  std::vector<Event> events_;  // guarded by mutex_
};

}  // namespace trammel::test
