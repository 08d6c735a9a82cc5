// Loaded before the program (LD_PRELOAD): one call of one kind fails, once.
//   UNFURL_FAULT=KIND:N    the Nth call of KIND: new, write, read, fsync, rename, open, thread
//   UNFURL_FAULT_COUNT=F   how many calls of the kind there were is written to file F at the end
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <new>

namespace {

struct Plan {
  char kind[16] = "";
  long at = -1;
  const char* count_file = nullptr;
  std::atomic<long> calls{0};
};

Plan g_plan;
std::atomic<bool> g_ready{false};

__attribute__((constructor)) void Prepare() {
  if (const char* fault = getenv("UNFURL_FAULT")) {
    const char* colon = strchr(fault, ':');
    if (colon != nullptr && colon - fault < 15) {
      memcpy(g_plan.kind, fault, static_cast<std::size_t>(colon - fault));
      g_plan.at = strtol(colon + 1, nullptr, 10);
    }
  }
  g_plan.count_file = getenv("UNFURL_FAULT_COUNT");
  unsetenv("LD_PRELOAD");  // programs that this one starts are left alone
}

__attribute__((destructor)) void Report() {
  g_ready = false;
  if (g_plan.count_file == nullptr) return;
  char text[32];
  const int length = snprintf(text, sizeof text, "%ld\n", g_plan.calls.load());
  const int file = open(g_plan.count_file, O_CREAT | O_TRUNC | O_WRONLY | O_CLOEXEC, 0600);
  if (file < 0) return;
  if (write(file, text, static_cast<std::size_t>(length)) != length) unlink(g_plan.count_file);
  close(file);
}

// Whether this call is the one that fails.
bool Fails(const char* kind) {
  if (!g_ready || strcmp(kind, g_plan.kind) != 0) return false;
  return g_plan.calls.fetch_add(1) + 1 == g_plan.at;
}

template <typename F>
F* Real(const char* name) {
  return reinterpret_cast<F*>(dlsym(RTLD_NEXT, name));
}

bool IsFile(int file) {
  struct stat info = {};
  return fstat(file, &info) == 0 && S_ISREG(info.st_mode);
}

}  // namespace

void* operator new(std::size_t size) {
  if (Fails("new")) {
    if (const std::new_handler refused = std::get_new_handler()) refused();
    throw std::bad_alloc();
  }
  if (void* memory = malloc(size > 0 ? size : 1)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept { free(memory); }
void operator delete(void* memory, std::size_t) noexcept { free(memory); }

namespace {

using Main = int(int, char**, char**);
Main* g_main = nullptr;

// What libraries do before and after main is theirs.
int CountingMain(int argc, char** argv, char** environment) {
  g_ready = true;
  const int code = g_main(argc, argv, environment);
  g_ready = false;
  return code;
}

}  // namespace

extern "C" {

int __libc_start_main(Main* program, int argc, char** argv, void (*begin)(), void (*end)(),
                      void (*loader_end)(), void* stack) {
  g_main = program;
  static auto* const real =
      Real<int(Main*, int, char**, void (*)(), void (*)(), void (*)(), void*)>("__libc_start_main");
  return real(CountingMain, argc, argv, begin, end, loader_end, stack);
}

ssize_t pwrite64(int file, const void* bytes, size_t count, off64_t at) {
  static auto* const real = Real<ssize_t(int, const void*, size_t, off64_t)>("pwrite64");
  if (IsFile(file) && Fails("write")) return errno = ENOSPC, -1;
  return real(file, bytes, count, at);
}

ssize_t pwrite(int file, const void* bytes, size_t count, off_t at) {
  static auto* const real = Real<ssize_t(int, const void*, size_t, off_t)>("pwrite");
  if (IsFile(file) && Fails("write")) return errno = ENOSPC, -1;
  return real(file, bytes, count, at);
}

size_t fwrite(const void* bytes, size_t size, size_t count, FILE* stream) {
  static auto* const real = Real<size_t(const void*, size_t, size_t, FILE*)>("fwrite");
  if (IsFile(fileno(stream)) && stream != stdout && stream != stderr && Fails("write")) {
    return errno = ENOSPC, 0;
  }
  return real(bytes, size, count, stream);
}

ssize_t pread64(int file, void* bytes, size_t count, off64_t at) {
  static auto* const real = Real<ssize_t(int, void*, size_t, off64_t)>("pread64");
  if (IsFile(file) && Fails("read")) return errno = EIO, -1;
  return real(file, bytes, count, at);
}

ssize_t pread(int file, void* bytes, size_t count, off_t at) {
  static auto* const real = Real<ssize_t(int, void*, size_t, off_t)>("pread");
  if (IsFile(file) && Fails("read")) return errno = EIO, -1;
  return real(file, bytes, count, at);
}

int fsync(int file) {
  static auto* const real = Real<int(int)>("fsync");
  if (Fails("fsync")) return errno = EIO, -1;
  return real(file);
}

int rename(const char* from, const char* to) noexcept {
  static auto* const real = Real<int(const char*, const char*)>("rename");
  if (Fails("rename")) return errno = EACCES, -1;
  return real(from, to);
}

FILE* fopen64(const char* path, const char* mode) {
  static auto* const real = Real<FILE*(const char*, const char*)>("fopen64");
  if (Fails("open")) return errno = EMFILE, nullptr;
  return real(path, mode);
}

FILE* fopen(const char* path, const char* mode) {
  static auto* const real = Real<FILE*(const char*, const char*)>("fopen");
  if (Fails("open")) return errno = EMFILE, nullptr;
  return real(path, mode);
}

int pthread_create(pthread_t* thread, const pthread_attr_t* how, void* (*run)(void*),
                   void* with) noexcept {
  static auto* const real =
      Real<int(pthread_t*, const pthread_attr_t*, void* (*)(void*), void*)>("pthread_create");
  if (Fails("thread")) return EAGAIN;
  return real(thread, how, run, with);
}

}  // extern "C"
