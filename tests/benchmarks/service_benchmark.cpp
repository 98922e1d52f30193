// The cost of the service beside a raw Fast DDS echo of the same payload with the same threads,
// interleaved in one run: only the ratios count. `service_benchmark [--quick] [overhead] [http]
// [load] [training] [flood]`; none named: all but training. Models are trained once and kept in the
// build folder.
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <functional>
#include <random>

#include "clients/session/session.h"
#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/compensate/model_file.h"
#include "server/dds/service_events.h"
#include "server/store/store.h"
#include "server/tasks/train/train.h"
#include "tests/benchmarks/service_asker.h"
#include "tests/support/daemon.h"
#include "tests/support/demand.h"
#include "tests/support/figure.h"
#include "tests/support/http_client.h"
#include "tests/support/virtual_cell.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

using test::Millis;
using Clock = std::chrono::steady_clock;
constexpr int kWorkers = 2;

double percentile(std::vector<double> values, double share) {
  if (values.empty()) return std::nan("");
  const auto at = static_cast<std::size_t>(share * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(at), values.end());
  return values[at];
}

// ---- payloads
// ------------------------------------------------------------------------------------------------------

wire::Approach unknown_approach() {
  wire::Approach approach;
  approach.temperature_c(std::nan(""));
  approach.time_s(std::nan(""));
  return approach;
}

wire::CorrectTargetRequest corrections_of(const std::vector<std::vector<double>>& joints) {
  wire::CorrectTargetRequest request;
  request.about().cell("cell-7");
  for (const auto& q : joints) {
    wire::Target target;
    target.kind(wire::TARGET_JOINTS);
    target.joints_rad(q);
    target.approach(unknown_approach());
    request.targets().push_back(target);
  }
  return request;
}

wire::PredictErrorRequest predictions_of(const std::vector<std::vector<double>>& joints) {
  wire::PredictErrorRequest request;
  request.about().cell("cell-7");
  for (const auto& q : joints) {
    wire::CommandedJoints pose;
    pose.joints_rad(q);
    pose.approach(unknown_approach());
    request.poses().push_back(pose);
  }
  return request;
}

void fill(const wire::CorrectTargetRequest& request, wire::CorrectTargetReply& reply) {
  wire::CorrectedTarget item;
  item.joints_rad(std::vector<double>(6));
  reply.corrections().assign(request.targets().size(), item);
}

void fill(const wire::PredictErrorRequest& request, wire::PredictErrorReply& reply) {
  reply.predictions().resize(request.poses().size());
}

// ---- the echo, a process of its own as the daemon is
// ----------------------------------------------------------------

int serve_echo(std::uint32_t domain, std::uint16_t port) {
  ServiceEvents events;
  const auto participant =
      wire::make_participant({"echo", domain, "127.0.0.1", port, {}}, &events).value();
  test::Echo<wire::CorrectTarget> corrections(*participant, fill, kWorkers);
  test::Echo<wire::PredictError> predictions(*participant, fill, kWorkers);
  std::puts("ready");
  std::fflush(stdout);
  const std::stop_source never;
  while (true) {
    const auto news = events.wait(never.get_token(), std::chrono::seconds(1));
    for (const ReaderEvent& event : news.readers) {
      if (event.kind != ReaderEvent::Kind::kFound) continue;
      const std::string& partition = event.reader.partition;
      if (event.reader.topic == corrections.reply_topic() && !corrections.expects(partition))
        corrections.expect(partition);
      if (event.reader.topic == predictions.reply_topic() && !predictions.expects(partition))
        predictions.expect(partition);
    }
  }
}

// ---- the daemon with a model
// ------------------------------------------------------------------------------------------

struct ModelSpec {
  std::string name, level, bias;
};
const std::vector<ModelSpec> kModels = {{"none", "M3", "none"},
                                        {"se", "M3", "se"},
                                        {"coupled", "M3", "matern52 + joint_map + parameters"}};

CompensatedModel model_of(const ModelSpec& spec, int poses) {
  const std::string folder = TRAMMEL_BINARY_DIR "/benchmark_models";
  const std::string path = fmt::format("{}/{}-{}.model", folder, spec.name, poses);
  if (std::filesystem::exists(path)) {
    if (auto kept = load_model(path)) return *std::move(kept);
  }
  TrainOptions options;
  options.level = spec.level;
  options.bias = spec.bias;
  const VirtualRobot robot = test::chapter_5_robot(test::cell_7());
  auto model = test::demand(train(robot.truth.cell, test::measured(robot, poses, 11), options));
  std::filesystem::create_directories(folder);
  if (const Status written = write_text_file(path, serialize(model)); !written) std::abort();
  return model;
}

/// A daemon that serves the model, and an echo beside it.
class Bench {
 public:
  explicit Bench(const CompensatedModel& model) {
    const Status written = write_text_file(
        daemon_.config_path(), fmt::format("{}http: {{port: {}, api: true}}\n",
                                           test::read_file(daemon_.config_path()), http_port()));
    if (!written) std::abort();
    {
      auto store = test::demand(Store::open(daemon_.store_path()));
      static_cast<void>(test::demand(store->add_model("cell-7", model, 0, true, "benchmark")));
    }
    daemon_.start();
    echo_ = std::make_unique<test::Process>(
        std::vector<std::string>{std::filesystem::read_symlink("/proc/self/exe"), "--echo",
                                 std::to_string(daemon_.domain()), std::to_string(echo_port())});
    if (!echo_->wait_for_line("ready", std::chrono::seconds(30))) std::abort();
  }
  [[nodiscard]] std::uint16_t echo_port() const {
    return static_cast<std::uint16_t>(daemon_.port() + 2);
  }
  [[nodiscard]] std::uint16_t http_port() const {
    return static_cast<std::uint16_t>(daemon_.port() + 4);
  }
  [[nodiscard]] test::Daemon& daemon() { return daemon_; }

  /// Of the daemon or the echo.
  template <typename Operation>
  [[nodiscard]] std::unique_ptr<test::Asker<Operation>> asker(bool of_echo,
                                                              const std::string& name) {
    const std::uint16_t port = of_echo ? echo_port() : daemon_.port();
    auto asker = std::make_unique<test::Asker<Operation>>(
        daemon_.domain(), port, fmt::format("{}-{}", name, of_echo ? "echo" : "service"));
    if (!asker->wait_until_matched()) std::abort();
    return asker;
  }

 private:
  test::Daemon daemon_;
  std::unique_ptr<test::Process> echo_;
};

// ---- one request after the other
// ---------------------------------------------------------------------------------------

/// Computes the items of a request without the service, on as many threads as it has workers.
double compute_ms(const std::function<void(std::size_t)>& item, std::size_t items) {
  const auto begun = Clock::now();
  if (items == 1) {
    item(0);
  } else {
    std::atomic<std::size_t> next = 0;
    std::vector<std::jthread> threads;
    for (int k = 0; k < kWorkers; ++k) {
      threads.emplace_back([&] {
        for (std::size_t i = next++; i < items; i = next++) item(i);
      });
    }
  }
  return Millis(Clock::now() - begun).count();
}

struct Times {
  std::vector<double> echo, service, compute;  // ms
};

template <typename Operation>
Times interleaved(Bench& bench, typename Operation::Request::type request, std::size_t items,
                  const std::function<void(std::size_t)>& item, int rounds) {
  const auto echo = bench.asker<Operation>(true, "one");
  const auto service = bench.asker<Operation>(false, "one");
  Times times;
  for (int i = -2; i < rounds; ++i) {
    const auto of_echo = echo->ask(request);
    const auto of_service = service->ask(request);
    const double alone = compute_ms(item, items);
    if (!of_echo || !of_service) std::abort();
    if (i < 0) continue;  // warms up
    times.echo.push_back(of_echo->count());
    times.service.push_back(of_service->count());
    times.compute.push_back(alone);
  }
  return times;
}

void tell(const std::string& what, const Times& times) {
  const double echo = percentile(times.echo, 0.5), compute = percentile(times.compute, 0.5);
  const double echo_99 = percentile(times.echo, 0.99), compute_99 = percentile(times.compute, 0.99);
  const double total = percentile(times.service, 0.5), total_99 = percentile(times.service, 0.99);
  std::printf("%s: echo %.3f / %.3f ms (p50 / p99), service %.3f / %.3f, compute %.3f / %.3f\n",
              what.c_str(), echo, echo_99, total, total_99, compute, compute_99);
  test::tell_figure(what + ", over the echo, p50", total / echo);
  test::tell_figure(what + ", over the echo, p99", total_99 / echo_99);
  test::tell_figure(what + ", over the echo and computing, p50", total / (echo + compute));
  test::tell_figure(what + ", overhead over the echo, p50", (total - compute) / echo);
  test::tell_figure(what + ", overhead over the echo, p99", (total_99 - compute) / echo_99);
}

void overhead(bool quick) {
  for (const ModelSpec& spec : kModels) {
    const CompensatedModel model = model_of(spec, quick ? 300 : 1200);
    const auto& [used_tool, used_payload] = *model.parts().trained_with.begin();
    const std::string tool = used_tool, payload = used_payload;
    Bench bench(model);
    for (const std::size_t items : {std::size_t{1}, std::size_t{10000}}) {
      const auto joints = test::virtual_joints(static_cast<int>(items), 5);
      std::vector<JointVector> q;
      for (const auto& one : joints) q.push_back(Eigen::Map<const Eigen::VectorXd>(one.data(), 6));
      // An item of a coupled bias takes some milliseconds.
      const bool is_slow = items > 1 && spec.name == "coupled";
      const int rounds = items == 1 ? (quick ? 200 : 1000) : (quick || is_slow ? 3 : 20);
      const auto correct = [&](std::size_t i) {
        Target target;
        target.joint_target = true;
        target.seed = q[i];
        static_cast<void>(model.correct(target, tool, payload));
      };
      const auto predict = [&](std::size_t i) {
        static_cast<void>(model.predict(q[i], tool, payload));
      };
      tell(fmt::format("CorrectTarget of {}, {}", items, spec.name),
           interleaved<wire::CorrectTarget>(bench, corrections_of(joints), items, correct, rounds));
      tell(fmt::format("PredictError of {}, {}", items, spec.name),
           interleaved<wire::PredictError>(bench, predictions_of(joints), items, predict, rounds));
    }
  }
}

/// One prediction after the other on one connection, beside the same on DDS.
void over_http(bool quick) {
  Bench bench(model_of(kModels[1], quick ? 300 : 1200));
  const auto on_dds = bench.asker<wire::PredictError>(false, "dds");
  const auto joints = test::virtual_joints(1, 5);
  auto request = predictions_of(joints);
  std::string list;
  for (const double q : joints[0]) list += fmt::format("{}{}", list.empty() ? "" : ",", to_deg(q));
  const std::string body = fmt::format(R"({{"poses":[{{"joints_deg":[{}]}}]}})", list);
  const std::string text = fmt::format(
      "POST /api/v1/cells/cell-7/predict HTTP/1.1\r\nHost: 127.0.0.1\r\n"
      "Content-Type: application/json\r\nContent-Length: {}\r\n\r\n{}",
      body.size(), body);
  const test::OpenConnection connection(bench.http_port());
  std::vector<double> dds, http;
  for (int i = -50; i < (quick ? 1000 : 5000); ++i) {
    const auto answered = on_dds->ask(request);
    const auto begun = Clock::now();
    connection.send(text);
    const std::string answer = connection.read_answer(std::chrono::seconds(10));
    const double took = Millis(Clock::now() - begun).count();
    if (!answered || !answer.starts_with("HTTP/1.1 200")) std::abort();
    if (i < 0) continue;  // warms up
    dds.push_back(answered->count());
    http.push_back(took);
  }
  std::printf("PredictError of 1, se: on DDS %.3f / %.3f ms (p50 / p99), over HTTP %.3f / %.3f\n",
              percentile(dds, 0.5), percentile(dds, 0.99), percentile(http, 0.5),
              percentile(http, 0.99));
  test::tell_figure("PredictError of 1, se, over HTTP beside DDS, p50",
                    percentile(http, 0.5) / percentile(dds, 0.5));
}

// ---- many clients
// -------------------------------------------------------------------------------------------------------

using Corrector = test::Asker<wire::CorrectTarget>;
using Correctors = std::vector<std::unique_ptr<Corrector>>;

/// Waits for a time; nobody wakes it.
class Pace {
 public:
  void until(Clock::time_point time) {
    std::unique_lock lock(mutex_);
    never_.wait_until(lock, time, [] { return false; });
  }

 private:
  std::mutex mutex_;
  std::condition_variable never_;
};

/// Each client sends so many a second, whether it is answered or not.
void send_at_rate(Correctors& clients, const wire::CorrectTargetRequest& request, int per_second,
                  double seconds) {
  std::vector<std::jthread> threads;
  for (auto& client : clients) {
    threads.emplace_back([&, at = client.get()] {
      Pace pace;
      wire::CorrectTargetRequest mine = request;
      const auto begun = Clock::now();
      const int count = static_cast<int>(per_second * seconds);
      for (int i = 0; i < count; ++i) {
        pace.until(begun + std::chrono::duration_cast<Clock::duration>(
                               std::chrono::duration<double>(i) / per_second));
        at->send(mine);
      }
    });
  }
}

struct LoadFigures {
  std::int64_t sent = 0, lost = 0, busy = 0, twice = 0;
  std::vector<double> times;
};

LoadFigures tally(Correctors& clients) {
  LoadFigures all;
  for (auto& client : clients) {
    client->wait_for_all(std::chrono::seconds(10));
    const auto one = client->tally();
    all.sent += one.sent;
    all.busy += one.busy;
    all.twice += one.twice;
    all.lost += one.sent - one.answered - one.busy;
    all.times.insert(all.times.end(), one.times_ms.begin(), one.times_ms.end());
  }
  return all;
}

Correctors correctors(Bench& bench, bool of_echo, int count, const std::string& name) {
  Correctors clients;
  for (int k = 0; k < count; ++k)
    clients.push_back(bench.asker<wire::CorrectTarget>(of_echo, name + std::to_string(k)));
  return clients;
}

void eight_clients(bool quick, bool with_training) {
  const CompensatedModel model = model_of(kModels[1], quick ? 300 : 1200);
  Bench bench(model);
  std::unique_ptr<client::Session> session;
  if (with_training) {
    session = test::demand(client::Session::open(bench.daemon().session_options()));
    const auto csv = test::virtual_batch_csv(quick ? 600 : 1200, 3);
    static_cast<void>(test::demand(session->submit_measurements("cell-7", "background", csv)));
  }
  Correctors echo = correctors(bench, true, 8, "load"),
             service = correctors(bench, false, 8, "load");
  const auto request = corrections_of(test::virtual_joints(1, 5));
  for (int round = 0; round < (quick ? 2 : 5); ++round) {
    send_at_rate(echo, request, 250, 1);
    send_at_rate(service, request, 250, 1);
  }
  const LoadFigures of_echo = tally(echo), of_service = tally(service);
  const std::string what =
      with_training ? "8 x 250 a second beside a training" : "8 x 250 a second";
  std::printf(
      "%s: %lld sent, echo %.3f / %.3f ms (p50 / p99.9), service %.3f / %.3f, %lld busy; echo lost "
      "%lld\n",
      what.c_str(), static_cast<long long>(of_service.sent), percentile(of_echo.times, 0.5),
      percentile(of_echo.times, 0.999), percentile(of_service.times, 0.5),
      percentile(of_service.times, 0.999), static_cast<long long>(of_service.busy),
      static_cast<long long>(of_echo.lost));
  test::tell_figure(what + ", lost", static_cast<double>(of_service.lost));
  test::tell_figure(what + ", answered twice", static_cast<double>(of_service.twice));
  test::tell_figure(what + ", busy", static_cast<double>(of_service.busy));
  test::tell_figure(what + ", over the echo, p99.9",
                    percentile(of_service.times, 0.999) / percentile(of_echo.times, 0.999));
}

/// Times of one client that asks for one correction after the other, a little apart.
std::vector<double> honest_times(Corrector& honest, int count) {
  auto request = corrections_of(test::virtual_joints(1, 5));
  Pace pace;
  std::vector<double> times;
  for (int i = 0; i < count; ++i) {
    const auto time = honest.ask(request, std::chrono::seconds(10));
    times.push_back(time ? time->count() : 10000);
    pace.until(Clock::now() + std::chrono::milliseconds(10));
  }
  return times;
}

void flood(bool quick) {
  const CompensatedModel model = model_of(kModels[1], quick ? 300 : 1200);
  Bench bench(model);
  const auto honest = bench.asker<wire::CorrectTarget>(false, "honest");
  const int count = quick ? 100 : 300;
  const std::vector<double> idle = honest_times(*honest, count);
  Correctors flooders = correctors(bench, false, 16, "flooder");
  const auto request = corrections_of(test::virtual_joints(500, 6));
  std::vector<double> times;
  {
    std::jthread sending([&] { send_at_rate(flooders, request, 20, quick ? 3 : 8); });
    times = honest_times(*honest, count);
  }
  const LoadFigures of_flooders = tally(flooders);
  std::printf(
      "16 flooders: %lld sent, %lld busy; one honest client %.3f / %.3f ms (p50 / p99), idle %.3f "
      "/ %.3f\n",
      static_cast<long long>(of_flooders.sent), static_cast<long long>(of_flooders.busy),
      percentile(times, 0.5), percentile(times, 0.99), percentile(idle, 0.5),
      percentile(idle, 0.99));
  test::tell_figure("16 flooders, neither answered nor told so",
                    static_cast<double>(of_flooders.lost));
  test::tell_figure("16 flooders, an honest client over idle, p50",
                    percentile(times, 0.5) / percentile(idle, 0.5));
  test::tell_figure("16 flooders, an honest client over idle, p99",
                    percentile(times, 0.99) / percentile(idle, 0.99));
}

int run(const std::vector<std::string>& words) {
  bool quick = false;
  std::vector<std::string> parts;
  for (const std::string& word : words) {
    if (word == "--quick")
      quick = true;
    else
      parts.push_back(word);
  }
  if (parts.empty()) parts = {"overhead", "http", "load", "flood"};
  for (const std::string& part : parts) {
    if (part == "overhead") {
      overhead(quick);
    } else if (part == "http") {
      over_http(quick);
    } else if (part == "load" || part == "training") {
      eight_clients(quick, part == "training");
    } else if (part == "flood") {
      flood(quick);
    } else {
      std::fprintf(stderr, "unknown part: %s\n", part.c_str());
      return 2;
    }
  }
  return 0;
}

}  // namespace
}  // namespace trammel

int main(int argc, char** argv) {
  if (argc == 4 && std::strcmp(argv[1], "--echo") == 0) {
    return trammel::serve_echo(static_cast<std::uint32_t>(std::stoul(argv[2])),
                               static_cast<std::uint16_t>(std::stoul(argv[3])));
  }
  return trammel::run({argv + 1, argv + argc});
}
