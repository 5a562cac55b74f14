#include "host_sim/study_runner.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <fstream>
#include <iterator>
#include <mutex>
#include <optional>
#include <span>
#include <system_error>
#include <thread>

#if RADAR_WITH_MPI
#include <mpi.h>
#endif

#include "host_sim/json_fields.hpp"

namespace sim {

namespace {

std::uint64_t fnv1a(std::span<const char> bytes) {
    std::uint64_t hash = 0xCBF2'9CE4'8422'2325;
    for (const char c : bytes) hash = (hash ^ static_cast<std::uint8_t>(c)) * 0x100'0000'01B3;
    return hash;
}

template <class T>
void put(std::vector<char>& bytes, const T& value) {
    const auto* p = reinterpret_cast<const char*>(&value);
    bytes.insert(bytes.end(), p, p + sizeof(T));
}

template <class T>
std::optional<T> take(std::span<const char>& bytes) {
    if (bytes.size() < sizeof(T)) return std::nullopt;
    T value;
    std::memcpy(&value, bytes.data(), sizeof(T));
    bytes = bytes.subspan(sizeof(T));
    return value;
}

/// Unit, number of values, values, checksum of all that.
std::vector<char> encode(std::size_t unit, const std::vector<double>& values) {
    std::vector<char> bytes;
    put(bytes, static_cast<std::uint64_t>(unit));
    put(bytes, static_cast<std::uint64_t>(values.size()));
    for (const double v : values) put(bytes, v);
    put(bytes, fnv1a(bytes));
    return bytes;
}

/// Fills in the records at the start of `bytes`; returns how many bytes they take. Stops at the first broken
/// one.
std::size_t decode(std::span<const char> bytes, std::vector<std::vector<double>>& results) {
    const std::size_t all = bytes.size();
    while (true) {
        std::span<const char> rest = bytes;
        const auto unit = take<std::uint64_t>(rest);
        const auto count = take<std::uint64_t>(rest);
        if (!unit || !count || *count > rest.size() / sizeof(double)) break;
        std::vector<double> values(*count);
        std::memcpy(values.data(), rest.data(), *count * sizeof(double));
        rest = rest.subspan(*count * sizeof(double));
        const std::size_t length = bytes.size() - rest.size();
        const auto sum = take<std::uint64_t>(rest);
        if (!sum || *sum != fnv1a(bytes.first(length))) break;
        if (*unit < results.size()) results[*unit] = std::move(values);
        bytes = rest;
    }
    return all - bytes.size();
}

std::vector<char> read_all(const std::filesystem::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

/// Appends records; a broken end is cut off first.
class ResultFile {
  public:
    ResultFile(const std::filesystem::path& file, std::uint64_t configuration,
               std::vector<std::vector<double>>& results)
        : name_(file.string()) {
        std::vector<char> bytes = read_all(file);
        std::size_t good = 0;
        if (bytes.size() >= sizeof(configuration)) {
            check(file, bytes, configuration);
            good = sizeof(configuration) +
                   decode(std::span<const char>(bytes).subspan(sizeof(configuration)), results);
        }
        std::error_code error;
        if (!bytes.empty()) std::filesystem::resize_file(file, good, error);
        out_.open(file, std::ios::binary | std::ios::app);
        if (good == 0) {
            bytes.clear();
            put(bytes, configuration);
            append(bytes);
        }
        if (!out_ || error) throw InputError(name_ + ": cannot be written");
    }
    void append(const std::vector<char>& bytes) {
        out_.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
        out_.flush();
        if (!out_) throw InputError(name_ + ": cannot be written");
    }

    static void check(const std::filesystem::path& file, std::span<const char> bytes,
                      std::uint64_t configuration) {
        if (take<std::uint64_t>(bytes) != configuration)
            throw InputError(
                file.string() +
                ": holds results of other scenarios, another seed or another version: remove it, or give "
                "another directory");
    }

  private:
    std::string name_;
    std::ofstream out_;
};

class Progress {
  public:
    Progress(std::size_t total, bool show) : total_(total), show_(show && total > 0) {}
    void done(std::size_t count) {
        const auto now = std::chrono::steady_clock::now();
        if (!show_ || (count < total_ && now - shown_ < std::chrono::seconds(1))) return;
        shown_ = now;
        const double elapsed = std::chrono::duration<double>(now - start_).count();
        const double left = elapsed / static_cast<double>(count) * static_cast<double>(total_ - count);
        std::fprintf(stderr, "\r%zu of %zu runs, %.0f s, about %.0f s left ", count, total_, elapsed, left);
        if (count == total_) std::fprintf(stderr, "\n");
    }

  private:
    std::size_t total_;
    bool show_;
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
    std::chrono::steady_clock::time_point shown_ = start_;
};

}  // namespace

#if RADAR_WITH_MPI

StudyRanks::StudyRanks() {
    // Without mpirun there is nobody to talk to, and starting MPI would cost half a second.
    if (std::getenv("OMPI_COMM_WORLD_SIZE") == nullptr && std::getenv("PMI_SIZE") == nullptr) return;
    MPI_Init(nullptr, nullptr);
    MPI_Comm_rank(MPI_COMM_WORLD, &self_.rank);
    MPI_Comm_size(MPI_COMM_WORLD, &self_.size);
}

StudyRanks::~StudyRanks() {
    int started = 0;
    MPI_Initialized(&started);
    if (started != 0) MPI_Finalize();
}

void StudyRanks::give_up() const {
    if (self_.size > 1) MPI_Abort(MPI_COMM_WORLD, 1);
}

std::vector<char> StudyRanks::gather(const std::vector<char>& mine) const {
    if (self_.size == 1) return mine;
    std::vector<char> all;
    // Point to point in pieces: counts of a collective are int, a study may be larger.
    constexpr std::size_t kPiece = std::size_t{1} << 28;
    if (self_.rank != 0) {
        const std::uint64_t size = mine.size();
        MPI_Send(&size, 1, MPI_UINT64_T, 0, 0, MPI_COMM_WORLD);
        for (std::size_t at = 0; at < mine.size(); at += kPiece)
            MPI_Send(mine.data() + at, static_cast<int>(std::min(kPiece, mine.size() - at)), MPI_CHAR, 0, 0,
                     MPI_COMM_WORLD);
        return all;
    }
    all = mine;
    for (int other = 1; other < self_.size; ++other) {
        std::uint64_t size = 0;
        MPI_Recv(&size, 1, MPI_UINT64_T, other, 0, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
        const std::size_t start = all.size();
        all.resize(start + size);
        for (std::size_t at = 0; at < size; at += kPiece)
            MPI_Recv(all.data() + start + at, static_cast<int>(std::min(kPiece, size - at)), MPI_CHAR, other,
                     0, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
    }
    return all;
}

std::vector<double> StudyRanks::spread(std::vector<double> values) const {
    if (self_.size == 1) return values;
    std::uint64_t size = values.size();
    MPI_Bcast(&size, 1, MPI_UINT64_T, 0, MPI_COMM_WORLD);
    values.resize(size);
    MPI_Bcast(values.data(), static_cast<int>(size), MPI_DOUBLE, 0, MPI_COMM_WORLD);
    return values;
}

#else

StudyRanks::StudyRanks() = default;
StudyRanks::~StudyRanks() = default;
void StudyRanks::give_up() const {}
std::vector<char> StudyRanks::gather(const std::vector<char>& mine) const {
    return mine;
}
std::vector<double> StudyRanks::spread(std::vector<double> values) const {
    return values;
}

#endif

std::vector<std::vector<double>> run_study_units(const StudyWork& work, const StudyRunOptions& options,
                                                 const StudyRanks& ranks) {
    const auto self = ranks.self();
    const auto rank = static_cast<std::size_t>(self.rank);
    const auto size = static_cast<std::size_t>(self.size);
    std::error_code error;
    std::filesystem::create_directories(options.directory, error);
    if (error) throw InputError(options.directory.string() + ": cannot be created: " + error.message());

    // The program itself is part of it: numbers of an older build must not pass for this one's.
    const std::vector<char> program = read_all("/proc/self/exe");
    const std::uint64_t configuration = fnv1a(work.configuration) ^ fnv1a(program);
    std::vector<std::vector<double>> results(work.units);
    const auto own_file = options.directory / (work.name + "." + std::to_string(rank) + ".runs");
    for (const auto& entry : std::filesystem::directory_iterator(options.directory)) {
        const std::string file = entry.path().filename().string();
        if (entry.path() == own_file || !file.starts_with(work.name + ".") || !file.ends_with(".runs"))
            continue;
        const std::vector<char> bytes = read_all(entry.path());
        // Another process may just have made it.
        if (bytes.size() < sizeof(configuration)) continue;
        ResultFile::check(entry.path(), bytes, configuration);
        decode(std::span<const char>(bytes).subspan(sizeof(configuration)), results);
    }
    ResultFile file(own_file, configuration, results);

    std::vector<std::size_t> to_do;
    for (std::size_t unit = rank; unit < work.units; unit += size)
        if (results[unit].empty()) to_do.push_back(unit);

    std::size_t threads = options.threads > 0
                              ? static_cast<std::size_t>(options.threads)
                              : std::max<std::size_t>(1, std::thread::hardware_concurrency() / size);
    threads = std::min(threads, std::max<std::size_t>(1, to_do.size()));
    Progress progress(to_do.size(), options.show_progress && rank == 0);
    std::atomic<std::size_t> next = 0;
    std::size_t finished = 0;
    std::exception_ptr failure;
    std::mutex mutex;
    const auto worker = [&] {
        try {
            for (std::size_t i = next++; i < to_do.size(); i = next++) {
                std::vector<double> values = work.run(to_do[i]);
                const std::lock_guard lock(mutex);
                file.append(encode(to_do[i], values));
                results[to_do[i]] = std::move(values);
                progress.done(++finished);
            }
        } catch (...) {
            const std::lock_guard lock(mutex);
            if (!failure) failure = std::current_exception();
            next = to_do.size();
        }
    };
    std::vector<std::thread> pool;
    for (std::size_t i = 1; i < threads; ++i) pool.emplace_back(worker);
    worker();
    for (std::thread& t : pool) t.join();
    if (failure) std::rethrow_exception(failure);

    if (size == 1) return results;
    std::vector<char> mine;
    for (std::size_t unit = rank; unit < work.units; unit += size) {
        const std::vector<char> record = encode(unit, results[unit]);
        mine.insert(mine.end(), record.begin(), record.end());
    }
    const std::vector<char> all = ranks.gather(mine);
    if (rank != 0) return {};
    decode(all, results);
    return results;
}

}  // namespace sim
