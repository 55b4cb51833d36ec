/// impinge.hpp: exact collision detection for deforming meshes, in C++17. A layer of classes over impinge.h, which says what each question
/// means; nothing but the standard library is needed, and nothing is compiled but this header.
///
/// Ownership. Scenes, detectors and answers own their handle and can be moved. An answer outlives its scene and its detector; the views that it
///   gives live as long as it does. Arrays that are passed in are read during the call, but for those of `lend_positions`.
/// Errors. A call that fails throws `impinge::error`; `stats()`, `start_intersects()` and `n_bodies()` never do, and say what they give then.
///   Where exceptions are off, or IMPINGE_NO_EXCEPTIONS is defined, each call gives a `result<T>` instead. `ok()` says whether the call
///   succeeded. So does a test such as `if (pairs)`, but the result of a number, a body, a bool or a std::optional cannot be tested: write
///   `any.ok() && *any`, `n.ok() && *n > 0`. Units of both modes may be in one program. Their classes are different types, so that a unit that
///   hands an object to one of the other mode does not link.
/// Threads. As in impinge.h: one thread at a time changes a handle, and each question changes its detector. A detector that is in use
///   refuses another question, and a scene that is asked about refuses changes, also those of callbacks. A scene or a detector must not
///   end, nor be moved from, while a call uses it.
#ifndef IMPINGE_HPP
#define IMPINGE_HPP

#include <impinge/answers.hpp>

#include <functional>
#ifndef IMPINGE_NO_EXCEPTIONS
#include <map>
#include <mutex>
#include <thread>
#endif

namespace impinge {
inline namespace IMPINGE_MODE {

/// The settings of a detector, and the callbacks that its questions call on the thread that asks.
class settings {
public:
  settings() { impinge_settings_default(&raw_); }
  settings(impinge::backend of) : settings() { backend(of); }
  settings &backend(impinge::backend of) & { return set(raw_.backend, static_cast<std::uint32_t>(of)); }
  settings &method(impinge::method of) & { return set(raw_.method, static_cast<std::uint32_t>(of)); }
  /// Threads of the CPU; 0 for one per core.
  settings &threads(std::uint32_t n) & { return set(raw_.threads, n); }
  settings &memory_budget(std::uint64_t bytes) & { return set(raw_.memory_budget, bytes); }
  settings &max_pairs(std::uint64_t n) & { return set(raw_.max_pairs, n); }
  /// Near pairs are listed with this margin, and only those looked at while no vertex has moved farther than half of it; 0 for no lists.
  settings &reuse_margin(double length) & { return set(raw_.reuse_margin, length); }
  double reuse_margin() const { return raw_.reuse_margin; }
  settings &device(std::string name) & { return set(device_, std::move(name)); }
  /// Stops a question when it gives true. What a callback throws stops the question too, and comes out of it.
  settings &cancelled(std::function<bool()> call) & { return set(cancelled_, std::move(call)); }
  settings &progress(std::function<void(std::uint64_t done, std::uint64_t total)> call) & { return set(progress_, std::move(call)); }
  settings &log(std::function<void(std::uint32_t level, const char *message)> call) & { return set(log_, std::move(call)); }

  // The same of a temporary, which a reference then keeps.
  settings backend(impinge::backend of) && { return std::move(backend(of)); }
  settings method(impinge::method of) && { return std::move(method(of)); }
  settings threads(std::uint32_t n) && { return std::move(threads(n)); }
  settings memory_budget(std::uint64_t bytes) && { return std::move(memory_budget(bytes)); }
  settings max_pairs(std::uint64_t n) && { return std::move(max_pairs(n)); }
  settings reuse_margin(double length) && { return std::move(reuse_margin(length)); }
  settings device(std::string name) && { return std::move(device(std::move(name))); }
  settings cancelled(std::function<bool()> call) && { return std::move(cancelled(std::move(call))); }
  settings progress(std::function<void(std::uint64_t done, std::uint64_t total)> call) && { return std::move(progress(std::move(call))); }
  settings log(std::function<void(std::uint32_t level, const char *message)> call) && { return std::move(log(std::move(call))); }

private:
  friend class detector;
  template <class T> settings &set(T &field, T value) {
    field = std::move(value);
    return *this;
  }
  impinge_settings raw_;
  std::string device_;
  std::function<bool()> cancelled_;
  std::function<void(std::uint64_t, std::uint64_t)> progress_;
  std::function<void(std::uint32_t, const char *)> log_;
};

/// Finds pairs, question after question. What each means is said in impinge.h.
class detector {
public:
  detector(settings of = {}) {
    if (of.cancelled_ || of.progress_ || of.log_) watch_ = std::make_unique<watch>();
    impinge_settings raw = of.raw_;
    if (!of.device_.empty()) raw.device = of.device_.c_str();
    raw.user = watch_.get();
    if (of.cancelled_ || of.progress_) raw.cancelled = watch::stop;
    if (of.progress_) raw.progress = watch::step;
    if (of.log_) raw.log = watch::say;
    if (watch_) {
      watch_->cancelled = std::move(of.cancelled_);
      watch_->progress = std::move(of.progress_);
      watch_->log = std::move(of.log_);
    }
    detail::made<impinge_detector> made;
    const auto status = impinge_detector_create(&raw, made.out());
    handle_.reset(made.take());
#ifndef IMPINGE_NO_EXCEPTIONS
    give(status);
#else
    status_ = status; // Without a handle every question fails.
#endif
  }
  detector(impinge::backend of) : detector(settings(of)) {}
  /// The same as a result: without exceptions, it says why there is none.
  static result<detector> make(settings of = {}) {
    detector made(std::move(of));
#ifndef IMPINGE_NO_EXCEPTIONS
    return made;
#else
    const auto status = made.status_;
    return detail::give(status, std::move(made));
#endif
  }

  result<pairs> detect(const scene &in, const query &of = {}) { return ask<pairs, impinge_pairs>(impinge_detect, in, of); }
  result<std::uint64_t> count(const scene &in, const query &of = {}) { return value<std::uint64_t>(impinge_count, in, of); }
  result<bool> any(const scene &in, const query &of = {}) { return yes(impinge_any, in, of); }
  result<impinge::impacts> impacts(const scene &in, const query &of = {}) { return ask<impinge::impacts, impinge_impacts>(impinge_find_impacts, in, of); }
  result<std::optional<impact>> earliest(const scene &in, const query &of = {}) {
    const impinge_query raw = of.raw();
    impact first{};
    std::int32_t found = 0;
    const auto status = impinge_find_earliest(this->raw(), in.raw(), &raw, &first, &found);
    return give(status, found != 0 ? std::optional<impact>(first) : std::nullopt);
  }
  result<bool> is_free(const scene &in, const query &of = {}) { return yes(impinge_is_free, in, of); }
  result<impinge::advance> advance(const scene &in, const query &of = {}) {
    const impinge_query raw = of.raw();
    detail::made<impinge_motion> made;
    const auto status = impinge_advance(this->raw(), in.raw(), &raw, nullptr, made.out());
    return give(status, impinge::advance(made.take()));
  }
  /// How far each vertex can go: each stops for itself.
  result<truncation> truncate(const scene &in, const query &of = {}) { return ask<truncation, impinge_motion>(impinge_truncate, in, of); }
  /// Only the fraction: no positions are kept.
  result<double> advance_fraction(const scene &in, const query &of = {}) {
    const impinge_query raw = of.raw();
    double fraction = 0;
    const auto status = impinge_advance(this->raw(), in.raw(), &raw, &fraction, nullptr);
    return give(status, std::move(fraction));
  }
  result<impinge::candidates> candidates(const scene &in, double inflation, const query &of = {}) {
    const impinge_query raw = of.raw();
    detail::made<impinge_candidates> made;
    const auto status = impinge_find_candidates(this->raw(), in.raw(), inflation, &raw, made.out());
    return give(status, impinge::candidates(made.take()));
  }
  /// `each(kind, rows)` gets runs of at most `most` candidates, and stops the search by giving false. The number of candidates handed out.
  template <class Each> result<std::uint64_t> candidates_in_runs(const scene &in, double inflation, std::uint64_t most, Each each, const query &of = {}) {
    struct run {
      Each *each;
#ifndef IMPINGE_NO_EXCEPTIONS
      std::exception_ptr thrown;
#endif
      static int hand_out(void *user, std::uint32_t kind, const pair *rows, std::size_t n) {
        auto &of = *static_cast<run *>(user);
#ifndef IMPINGE_NO_EXCEPTIONS
        try {
          return (*of.each)(static_cast<pair_kind>(kind), view<pair>(rows, n)) ? 0 : 1;
        } catch (...) {
          of.thrown = std::current_exception();
          return 1;
        }
#else
        return (*of.each)(static_cast<pair_kind>(kind), view<pair>(rows, n)) ? 0 : 1;
#endif
      }
    };
    run user{};
    user.each = &each;
    std::uint64_t n = 0;
    const impinge_query raw = of.raw();
    const auto status = impinge_find_candidates_in_runs(this->raw(), in.raw(), inflation, &raw, most, run::hand_out, &user, &n);
#ifndef IMPINGE_NO_EXCEPTIONS
    if (user.thrown) {
      if (watch_) watch_->take(); // It is not for the next question.
      std::rethrow_exception(user.thrown);
    }
#endif
    return give(status, std::move(n));
  }
  /// Pairs at most `distance` apart; an edge and a face only if they meet.
  result<near_pairs> near(const scene &in, double distance, const query &of = {}) {
    const impinge_query raw = of.raw();
    detail::made<impinge_near> made;
    const auto status = impinge_find_near(this->raw(), in.raw(), distance, &raw, made.out());
    return give(status, near_pairs(made.take()));
  }
  /// How far each vertex may move, at most `most`, so that nothing touches. The time grows with `most`: let it be no more than a vertex moves
  /// in one step.
  result<impinge::safe_distances> safe_distances(const scene &in, double most, const query &of = {}) {
    const impinge_query raw = of.raw();
    detail::made<impinge_safe_distances> made;
    const auto status = impinge_find_safe_distances(this->raw(), in.raw(), most, &raw, made.out());
    return give(status, impinge::safe_distances(made.take()));
  }
  result<impinge::neighbours> neighbours(const scene &in, double distance, const query &of = {}) {
    const impinge_query raw = of.raw();
    detail::made<impinge_neighbours> made;
    const auto status = impinge_find_neighbours(this->raw(), in.raw(), distance, &raw, made.out());
    return give(status, impinge::neighbours(made.take()));
  }
  /// Where each point lies: inside a body 1, on its surface 0, outside -1.
  template <class P> result<std::vector<std::int8_t>> contains(const scene &in, body of, const P &points) {
    const array at = detail::rows_of(points, 3);
    std::vector<std::int8_t> places(at.rows);
    const auto status = impinge_contains(raw(), in.raw(), of, at, places.data());
    return give(status, std::move(places));
  }
  /// How far each point is from the surface of a body: above 0 inside, below 0 outside.
  template <class P> result<std::vector<double>> signed_distance(const scene &in, body of, const P &points) {
    const array at = detail::rows_of(points, 3);
    std::vector<double> distances(at.rows);
    const auto status = impinge_signed_distance(raw(), in.raw(), of, at, distances.data());
    return give(status, std::move(distances));
  }
  /// How often a closed surface winds around each point, or IMPINGE_ON_SURFACE.
  template <class P> result<std::vector<std::int32_t>> winding_numbers(const scene &in, body of, const P &points) {
    const array at = detail::rows_of(points, 3);
    std::vector<std::int32_t> windings(at.rows);
    const auto status = impinge_winding_numbers(raw(), in.raw(), of, at, windings.data());
    return give(status, std::move(windings));
  }
  /// The lowest tetrahedron of a body that contains each point, or IMPINGE_NO_ELEMENT.
  template <class P> result<std::vector<std::uint32_t>> locate(const scene &in, body of, const P &points) {
    const array at = detail::rows_of(points, 3);
    std::vector<std::uint32_t> tetrahedra(at.rows);
    const auto status = impinge_locate(raw(), in.raw(), of, at, tetrahedra.data());
    return give(status, std::move(tetrahedra));
  }
  /// The element nearest to each point, if it is at most `most` away; with `query::n_nearest` the nearest few.
  template <class P>
  result<impinge::closest> closest(const scene &in, const P &points, double most = std::numeric_limits<double>::infinity(), const query &of = {}) {
    const impinge_query raw = of.raw();
    detail::made<impinge_closest> made;
    const auto status = impinge_find_closest(this->raw(), in.raw(), detail::rows_of(points, 3), most, &raw, made.out());
    return give(status, impinge::closest(made.take()));
  }
  /// What each ray hits, origin + t direction for t from 0 to `most`: 1 for segments. A direction of zero is the origin alone.
  template <class O, class D>
  result<impinge::hits> cast(const scene &in, const O &origins, const D &directions, double most = std::numeric_limits<double>::infinity(),
                             const query &of = {}) {
    const impinge_query raw = of.raw();
    detail::made<impinge_hits> made;
    const auto status =
        impinge_cast(this->raw(), in.raw(), detail::rows_of(origins, 3), detail::rows_of(directions, 3), most, &raw, made.out());
    return give(status, impinge::hits(made.take()));
  }
  /// The nearest two bodies of all that the query lets meet; nothing if there are none.
  result<std::optional<impinge::nearest>> nearest(const scene &in, const query &of = query::between_all()) {
    const impinge_query raw = of.raw();
    impinge::nearest least{};
    std::int32_t found = 0;
    const auto status = impinge_find_nearest(this->raw(), in.raw(), &raw, &least, &found);
    return give(status, found != 0 ? std::optional<impinge::nearest>(least) : std::nullopt);
  }
  /// The smallest distance of two bodies; nothing if one has no elements.
  result<std::optional<impinge::nearest>> distance(const scene &in, body a, body b) {
    impinge::nearest least{};
    std::int32_t found = 0;
    const auto status = impinge_find_distance(raw(), in.raw(), a, b, &least, &found);
    return give(status, found != 0 ? std::optional<impinge::nearest>(least) : std::nullopt);
  }
  result<impinge::contacts> contacts(const scene &in, const pairs &of) {
    detail::made<impinge_contacts> made;
    const auto status = impinge_find_contacts(raw(), in.raw(), of.raw(), made.out());
    return give(status, impinge::contacts(made.take()));
  }
  result<impinge::penetration> penetration(const scene &in, const impinge::contacts &of, body a, body b) {
    detail::made<impinge_penetration> made;
    const auto status = impinge_find_penetration(raw(), in.raw(), of.raw(), a, b, made.out());
    return give(status, impinge::penetration(made.take()));
  }
  /// Whether the start of the last step intersects; nothing if nobody asked, and while the detector is in use or where it is broken.
  std::optional<bool> start_intersects() const { return detail::asked(impinge_detector_start_intersects(raw())); }
  /// What the last question cost. Its strings live as long as the detector. While the detector is in use, or where it is broken, numbers are 0
  /// and strings empty.
  impinge_stats stats() const & { return detail::stats_of(impinge_detector_stats, raw()); }
  impinge_detector *raw() noexcept { return handle_.get(); }
  const impinge_detector *raw() const noexcept { return handle_.get(); }
  // A temporary ends before its views are read.
  void stats() const && = delete;

private:
#ifdef IMPINGE_NO_EXCEPTIONS
  impinge_status status_ = IMPINGE_OK;
#endif
  struct watch {
    std::function<bool()> cancelled;
    std::function<void(std::uint64_t, std::uint64_t)> progress;
    std::function<void(std::uint32_t, const char *)> log;
#ifndef IMPINGE_NO_EXCEPTIONS
    // What callbacks have thrown, each for the thread that asks: it takes that when the detector may be in use by the next thread already.
    std::map<std::thread::id, std::exception_ptr> thrown;
    std::mutex of_thrown;
    template <class Call> void guarded(Call call) {
      if (is_broken()) return;
      try {
        call();
      } catch (...) {
        const std::lock_guard<std::mutex> lock(of_thrown);
        thrown[std::this_thread::get_id()] = std::current_exception();
      }
    }
    bool is_broken() {
      const std::lock_guard<std::mutex> lock(of_thrown);
      return thrown.count(std::this_thread::get_id()) != 0;
    }
    /// What was thrown in the question that this thread asked; nothing if none was, or another thread's question refused this one.
    std::exception_ptr take() {
      const std::lock_guard<std::mutex> lock(of_thrown);
      auto held = thrown.extract(std::this_thread::get_id());
      return held ? std::move(held.mapped()) : nullptr;
    }
#else
    template <class Call> void guarded(Call call) { call(); }
    bool is_broken() const { return false; }
#endif
    static int stop(void *user) {
      auto &of = *static_cast<watch *>(user);
      bool stops = false;
      if (of.cancelled) of.guarded([&] { stops = of.cancelled(); });
      return stops || of.is_broken();
    }
    static void step(void *user, std::uint64_t done, std::uint64_t total) {
      auto &of = *static_cast<watch *>(user);
      of.guarded([&] { of.progress(done, total); });
    }
    static void say(void *user, std::uint32_t level, const char *message) {
      auto &of = *static_cast<watch *>(user);
      of.guarded([&] { of.log(level, message); });
    }
  };

#ifndef IMPINGE_NO_EXCEPTIONS
  void give(impinge_status status) {
    if (const auto thrown = watch_ ? watch_->take() : nullptr) std::rethrow_exception(thrown);
    detail::give(status);
  }
  template <class T> T give(impinge_status status, T &&value) {
    give(status);
    return std::forward<T>(value);
  }
#else
  template <class T> result<std::decay_t<T>> give(impinge_status status, T &&value) { return detail::give(status, std::forward<T>(value)); }
#endif

  template <class Answer, class Handle, class Call> result<Answer> ask(Call call, const scene &in, const query &of) {
    const impinge_query raw = of.raw();
    detail::made<Handle> made;
    const auto status = call(this->raw(), in.raw(), &raw, made.out());
    return give(status, Answer(made.take()));
  }
  template <class T, class Call> result<T> value(Call call, const scene &in, const query &of) {
    const impinge_query raw = of.raw();
    T value{};
    const auto status = call(this->raw(), in.raw(), &raw, &value);
    return give(status, std::move(value));
  }
  template <class Call> result<bool> yes(Call call, const scene &in, const query &of) {
    const impinge_query raw = of.raw();
    std::int32_t answer = 0;
    const auto status = call(this->raw(), in.raw(), &raw, &answer);
    return give(status, answer != 0);
  }

  std::unique_ptr<watch> watch_;
  detail::handle<impinge_detector, impinge_detector_destroy> handle_;
};

/// A GPU that the library can run on.
struct device_info {
  std::string name, interface_name, driver;
  std::uint64_t max_binding;
  bool is_software;
};

/// The GPUs of this machine, hardware first; none if the library was built without the GPU backend.
inline result<std::vector<device_info>> devices() {
  detail::made<impinge_devices> made;
  const auto status = impinge_find_devices(made.out());
  const detail::handle<impinge_devices, impinge_devices_destroy> held(made.take());
  std::vector<device_info> all;
  const auto *rows = impinge_devices_data(held.get());
  for (std::size_t ix = 0; ix < impinge_devices_count(held.get()); ++ix) {
    const auto &of = rows[ix];
    all.push_back({of.name, of.interface_name, of.driver, of.max_binding, of.is_software != 0});
  }
  return detail::give(status, std::move(all));
}

/// Vertices at equal positions as one.
struct weld_map {
  /// For each vertex before, its number after.
  std::vector<std::uint32_t> map;
  /// For each vertex after, the first one before that is at its position.
  std::vector<std::uint32_t> firsts;
};

/// Finds vertices whose positions are equal, as along the seams of a mesh for drawing.
template <class P> result<weld_map> weld(const P &positions) {
  const array at = detail::rows_of(positions, 3);
  weld_map of;
  of.map.resize(at.rows);
  of.firsts.resize(at.rows);
  std::size_t n = 0;
  const auto status = impinge_weld(at, of.map.data(), of.firsts.data(), &n);
  of.firsts.resize(n);
  return detail::give(status, std::move(of));
}

/// The first time at which two elements touch that no scene holds, rounded down; nothing if they do not. One row per vertex, those of the element
/// that `kind` names first come first. Of the query: separation and clearance.
template <class S, class E> result<std::optional<double>> first_contact(pair_kind kind, const S &start, const E &end, const query &of = {}) {
  const impinge_query raw = of.raw();
  double toi = 0;
  std::int32_t found = 0;
  const auto status = impinge_first_contact(static_cast<std::uint32_t>(kind), detail::rows_of(start, 3), detail::rows_of(end, 3), &raw, &toi, &found);
  return detail::give(status, found != 0 ? std::optional<double>(toi) : std::nullopt);
}

/// Replaces each symmetric matrix by the nearest one without negative eigenvalues: `stencils::hessians`, times a factor each. The same bits on every
/// machine.
template <std::size_t N> result<void> project_psd(std::vector<std::array<std::array<double, N>, N>> &matrices) {
  static_assert(N == 3 || N == 6 || N == 9 || N == 12, "matrices have 3, 6, 9 or 12 rows");
  return detail::give(impinge_project_psd(matrices.empty() ? nullptr : matrices.front().front().data(), matrices.size(), N));
}

/// The version of the library, such as "0.1.0".
inline const char *version() noexcept { return impinge_version(); }

} // namespace IMPINGE_MODE
} // namespace impinge

#endif // IMPINGE_HPP
