#include "server/dds/records/request_recorder.h"

#include <pthread.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <utility>
#include <vector>

namespace trammel {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kQueueBytes = std::size_t{64} << 20;
constexpr int kFiles = 8;  // that share the room
constexpr int kNiceness = 5;
constexpr const char* kBegin = "requests-";
constexpr const char* kEnd = ".jsonl";

/// 0: it is none of ours.
std::int64_t number_of(const fs::path& file) {
  const std::string name = file.filename().string(), begin = kBegin;
  if (!name.starts_with(begin) || !name.ends_with(kEnd)) return 0;
  std::int64_t number = 0;
  std::from_chars(name.data() + begin.size(), name.data() + name.size(), number);
  return number;
}

/// Oldest first.
std::vector<std::pair<std::int64_t, fs::path>> files_in(const std::string& folder) {
  std::vector<std::pair<std::int64_t, fs::path>> files;
  std::error_code unknown;
  for (const auto& entry : fs::directory_iterator(folder, unknown)) {
    if (const std::int64_t number = number_of(entry.path()); number > 0) files.emplace_back(number, entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

}  // namespace

Result<std::unique_ptr<RequestRecorder>> RequestRecorder::open(const RecordOptions& options) {
  if (options.folder.empty()) return nullptr;
  std::error_code wrong;
  fs::create_directories(options.folder, wrong);
  if (wrong || ::access(options.folder.c_str(), W_OK | X_OK) != 0)
    return refused("requests cannot be recorded there").in(options.folder).of("record: folder");
  std::unique_ptr<RequestRecorder> recorder(new RequestRecorder(options));
  const auto files = files_in(options.folder);
  recorder->number_ = files.empty() ? 0 : files.back().first;
  recorder->next_file();
  RequestRecorder* self = recorder.get();
  recorder->thread_ = std::jthread([self](const std::stop_token& stop) { self->run(stop); });
  return recorder;
}

RequestRecorder::~RequestRecorder() {
  thread_.request_stop();
  if (thread_.joinable()) thread_.join();
}

void RequestRecorder::record(std::function<std::string()> line, std::size_t bytes) {
  {
    const MutexLock lock(mutex_);
    if (waiting_bytes_ + bytes > kQueueBytes) {
      ++dropped_;
      return;
    }
    waiting_.push_back({std::move(line), bytes});
    waiting_bytes_ += bytes;
  }
  changed_.notify_one();
}

void RequestRecorder::run(const std::stop_token& stop) {
  ::pthread_setname_np(::pthread_self(), "recorder");
  ::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), kNiceness);  // of this thread alone
  while (true) {
    Waiting next;
    {
      MutexLock lock(mutex_);
      changed_.wait(lock, stop, [this]() TRAMMEL_REQUIRES(mutex_) { return !waiting_.empty(); });
      if (waiting_.empty()) return;  // only once it is to stop
      next = std::move(waiting_.front());
      waiting_.pop_front();
    }
    write(next.line());
    const MutexLock lock(mutex_);
    waiting_bytes_ -= next.bytes;
  }
}

void RequestRecorder::write(const std::string& line) {
  if (file_bytes_ > 0 && file_bytes_ + line.size() > (static_cast<std::size_t>(options_.max_mb) << 20) / kFiles)
    next_file();
  file_ << line << '\n' << std::flush;
  if (file_) {
    file_bytes_ += line.size() + 1;
    return;
  }
  ++dropped_;
  next_file();  // a disk that is full now may not be full later
}

void RequestRecorder::next_file() {
  auto files = files_in(options_.folder);
  for (std::size_t i = 0; i + kFiles <= files.size(); ++i) {
    std::error_code unknown;
    fs::remove(files[i].second, unknown);
  }
  const fs::path path = fs::path(options_.folder) / fmt::format("{}{:09}{}", kBegin, ++number_, kEnd);
  file_ = std::ofstream(path, std::ios::binary | std::ios::trunc);
  std::error_code unknown;
  fs::permissions(path, fs::perms::owner_read | fs::perms::owner_write, unknown);
  file_bytes_ = 0;
}

}  // namespace trammel
