// Runs a policy of `race train` in C++: policy POLICY.onnx OBSERVATION.txt
//
// The file contains normalisation, network and the limits of the actions; its metadata say what
// the numbers of an observation and of an action mean. Written against ONNX Runtime's C API,
// which is the same in all versions.

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <fstream>
#include <iterator>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <onnxruntime_c_api.h>

namespace {

constexpr int warm_up = 200;  // decisions that are not timed
constexpr int timed = 10000;

// The names of input, output and metadata in files of `race train`.
constexpr const char* input = "observation";
constexpr const char* output = "action";
constexpr const char* metadata_key = "race-server-policy";

const OrtApi& api() {
  static const OrtApi* const found = OrtGetApiBase()->GetApi(ORT_API_VERSION);
  if (found == nullptr) {
    throw std::runtime_error("the library is older than its header: install both of one version");
  }
  return *found;
}

void check(OrtStatus* status) {
  if (status == nullptr) {
    return;
  }
  const std::string words = api().GetErrorMessage(status);
  api().ReleaseStatus(status);
  throw std::runtime_error(words);
}

// An object of ONNX Runtime that is released at the end of its scope.
template <typename Thing>
using Held = std::unique_ptr<Thing, void (*)(Thing*)>;

template <typename Thing>
Held<Thing> hold(Thing* thing, void (*release)(Thing*)) {
  return Held<Thing>(thing, release);
}

class Policy {
 public:
  explicit Policy(const char* path)
      : environment_(hold<OrtEnv>(nullptr, api().ReleaseEnv)),
        session_(hold<OrtSession>(nullptr, api().ReleaseSession)),
        memory_(hold<OrtMemoryInfo>(nullptr, api().ReleaseMemoryInfo)) {
    OrtEnv* environment = nullptr;
    check(api().CreateEnv(ORT_LOGGING_LEVEL_ERROR, "policy", &environment));
    environment_.reset(environment);
    OrtSessionOptions* raw = nullptr;
    check(api().CreateSessionOptions(&raw));
    const auto options = hold(raw, api().ReleaseSessionOptions);
    // A network this small is slower on many threads.
    check(api().SetIntraOpNumThreads(raw, 1));
    check(api().SetInterOpNumThreads(raw, 1));
    OrtSession* session = nullptr;
    check(api().CreateSession(environment, path, raw, &session));
    session_.reset(session);
    OrtMemoryInfo* memory = nullptr;
    check(api().CreateCpuMemoryInfo(OrtArenaAllocator, OrtMemTypeDefault, &memory));
    memory_.reset(memory);
  }

  // Returns the policy's metadata as JSON.
  std::string metadata() const {
    OrtModelMetadata* raw = nullptr;
    check(api().SessionGetModelMetadata(session_.get(), &raw));
    const auto all = hold(raw, api().ReleaseModelMetadata);
    OrtAllocator* allocator = nullptr;
    check(api().GetAllocatorWithDefaultOptions(&allocator));
    char* value = nullptr;
    check(api().ModelMetadataLookupCustomMetadataMap(raw, allocator, metadata_key, &value));
    if (value == nullptr) {
      throw std::runtime_error(std::string("no policy of race-server: its metadata lack ") +
                               metadata_key);
    }
    const std::string words = value;
    check(api().AllocatorFree(allocator, value));
    return words;
  }

  // Returns the count of numbers in an observation.
  std::size_t size() const {
    OrtTypeInfo* raw = nullptr;
    check(api().SessionGetInputTypeInfo(session_.get(), 0, &raw));
    const auto type = hold(raw, api().ReleaseTypeInfo);
    const OrtTensorTypeAndShapeInfo* tensor = nullptr;
    check(api().CastTypeInfoToTensorInfo(raw, &tensor));
    std::int64_t shape[2] = {0, 0};  // count of observations, and their size
    check(api().GetDimensions(tensor, shape, std::size(shape)));
    return static_cast<std::size_t>(shape[1]);
  }

  std::vector<float> decide(std::vector<float>& observation) const {
    const std::int64_t shape[] = {1, static_cast<std::int64_t>(observation.size())};
    OrtValue* seen = nullptr;  // a view: nothing is copied
    check(api().CreateTensorWithDataAsOrtValue(
        memory_.get(), observation.data(), observation.size() * sizeof(float), shape,
        std::size(shape), ONNX_TENSOR_ELEMENT_DATA_TYPE_FLOAT, &seen));
    const auto held_seen = hold(seen, api().ReleaseValue);
    OrtValue* answer = nullptr;
    const OrtValue* const inputs[] = {seen};
    check(api().Run(session_.get(), nullptr, &input, inputs, 1, &output, 1, &answer));
    const auto held_answer = hold(answer, api().ReleaseValue);
    OrtTensorTypeAndShapeInfo* raw = nullptr;
    check(api().GetTensorTypeAndShape(answer, &raw));
    const auto tensor = hold(raw, api().ReleaseTensorTypeAndShapeInfo);
    std::size_t count = 0;
    check(api().GetTensorShapeElementCount(raw, &count));
    void* numbers = nullptr;
    check(api().GetTensorMutableData(answer, &numbers));
    const auto* first = static_cast<const float*>(numbers);
    return {first, first + count};
  }

 private:
  Held<OrtEnv> environment_;
  Held<OrtSession> session_;
  Held<OrtMemoryInfo> memory_;
};

std::vector<float> read_numbers(const std::string& path) {
  std::ifstream file(path);
  if (!file) {
    throw std::runtime_error(path + ": cannot be read");
  }
  std::vector<float> numbers{std::istream_iterator<float>(file), std::istream_iterator<float>()};
  if (!file.eof()) {
    throw std::runtime_error(path + ": contains something that is not a number");
  }
  return numbers;
}

// Prints the median and the 99th percentile of the time of a decision.
void print_times(const Policy& policy, std::vector<float>& observation) {
  using clock = std::chrono::steady_clock;
  for (int turn = 0; turn < warm_up; ++turn) {
    policy.decide(observation);
  }
  std::vector<double> times;
  for (int turn = 0; turn < timed; ++turn) {
    const auto begun = clock::now();
    policy.decide(observation);
    times.push_back(std::chrono::duration<double, std::micro>(clock::now() - begun).count());
  }
  std::sort(times.begin(), times.end());
  std::printf("decision: %.1f µs, 99 of 100 within %.1f µs\n", times[timed / 2],
              times[timed * 99 / 100]);
}

void run(const char* path, const std::string& observation_path) {
  const Policy policy(path);
  std::printf("%s: %s\n", metadata_key, policy.metadata().c_str());
  std::vector<float> observation = read_numbers(observation_path);
  if (observation.size() != policy.size()) {
    throw std::runtime_error(observation_path + ": " + std::to_string(observation.size()) +
                             " numbers, the policy takes " + std::to_string(policy.size()));
  }
  std::printf("action:");
  for (const float number : policy.decide(observation)) {
    std::printf(" %.9g", static_cast<double>(number));
  }
  std::printf("\n");
  print_times(policy, observation);
}

}  // namespace

int main(int count, char** words) {
  if (count != 3) {
    std::fprintf(stderr, "usage: %s POLICY.onnx OBSERVATION.txt\n", words[0]);
    return 2;
  }
  try {
    run(words[1], words[2]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "error: %s\n", error.what());
    return 2;
  }
  return 0;
}
