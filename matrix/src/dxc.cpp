// A command line for DXC's library, where there is no `dxc` program:
//   dxc LIBRARY --version
//   dxc LIBRARY SOURCE ENTRY PROFILE OUTPUT [DXC'S OWN ARGUMENTS...]
// Exit code 0: compiled, warnings on standard error; 1: refused, its words on standard error;
// 3: the library cannot be used.
//
// The interfaces are those of DXC 1.7 and older on Unix, whose IUnknown has a virtual destructor;
// of each only what is called is declared, and what stands before it in the table.
#include <dlfcn.h>

#include <cstdint>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

namespace {

struct Guid {
    uint32_t a;
    uint16_t b, c;
    uint8_t d[8];
};
using Result = int32_t;

constexpr Guid CLASS_LIBRARY = {0x6245d6af, 0x66e0, 0x48fd, {0x80, 0xb4, 0x4d, 0x27, 0x17, 0x96, 0x74, 0x8c}};
constexpr Guid LIBRARY = {0xe5204dc7, 0xd18c, 0x4c3c, {0xbd, 0xfb, 0x85, 0x16, 0x73, 0x98, 0x0f, 0xe7}};
constexpr Guid CLASS_COMPILER = {0x73e22d93, 0xe6ce, 0x47f3, {0xb5, 0xbf, 0xf0, 0x66, 0x4f, 0x39, 0xc1, 0xb0}};
constexpr Guid COMPILER = {0x8c210bf3, 0x011f, 0x4422, {0x8d, 0x70, 0x6f, 0x9a, 0xcb, 0x8d, 0xb6, 0x17}};
constexpr Guid VERSION_INFO = {0xb04f5b50, 0x2059, 0x4f12, {0xa8, 0xff, 0xa1, 0xe0, 0xcd, 0xe1, 0xcc, 0x7e}};

struct Unknown {
    virtual Result QueryInterface(const Guid &, void **) = 0;
    virtual uint32_t AddRef() = 0;
    virtual uint32_t Release() = 0;
    virtual ~Unknown() = default;
};

struct Blob : Unknown {
    virtual void *GetBufferPointer() = 0;
    virtual size_t GetBufferSize() = 0;
};

struct Outcome : Unknown {
    virtual Result GetStatus(Result *) = 0;
    virtual Result GetResult(Blob **) = 0;
    virtual Result GetErrorBuffer(Blob **) = 0;
};

struct Library : Unknown {
    virtual Result SetMalloc(void *) = 0;
    virtual Result CreateBlobFromBlob(Blob *, uint32_t, uint32_t, Blob **) = 0;
    virtual Result CreateBlobFromFile(const wchar_t *, uint32_t *, Blob **) = 0;
    virtual Result CreateBlobWithEncodingFromPinned(const void *, uint32_t, uint32_t, Blob **) = 0;
};

struct Compiler : Unknown {
    virtual Result Compile(Blob *source, const wchar_t *name, const wchar_t *entry, const wchar_t *profile,
                           const wchar_t **arguments, uint32_t count, const void *defines, uint32_t define_count,
                           void *includes, Outcome **) = 0;
};

struct VersionInfo : Unknown {
    virtual Result GetVersion(uint32_t *, uint32_t *) = 0;
};

std::wstring wide(const char *text) { return {text, text + std::char_traits<char>::length(text)}; }

int unusable(const char *what) {
    std::fprintf(stderr, "the library cannot be used: %s\n", what);
    return 3;
}

}  // namespace

int main(int count, char **arguments) {
    if (count < 3) return unusable("arguments are missing");
    void *handle = dlopen(arguments[1], RTLD_NOW);
    if (!handle) return unusable(dlerror());
    using Create = Result (*)(const Guid &, const Guid &, void **);
    auto create = reinterpret_cast<Create>(dlsym(handle, "DxcCreateInstance"));
    if (!create) return unusable("it has no DxcCreateInstance");
    Library *library = nullptr;
    Compiler *compiler = nullptr;
    if (create(CLASS_LIBRARY, LIBRARY, reinterpret_cast<void **>(&library)) < 0) return unusable("no IDxcLibrary");
    if (create(CLASS_COMPILER, COMPILER, reinterpret_cast<void **>(&compiler)) < 0) return unusable("no IDxcCompiler");

    if (std::string(arguments[2]) == "--version") {
        VersionInfo *info = nullptr;
        uint32_t major = 0, minor = 0;
        if (compiler->QueryInterface(VERSION_INFO, reinterpret_cast<void **>(&info)) < 0 ||
            info->GetVersion(&major, &minor) < 0)
            return unusable("it does not tell its version");
        std::printf("%u.%u\n", major, minor);
        return 0;
    }
    if (count < 6) return unusable("arguments are missing");

    std::ifstream file(arguments[2], std::ios::binary);
    if (!file) return unusable("the source cannot be read");
    const std::string text{std::istreambuf_iterator<char>(file), {}};
    constexpr uint32_t UTF8 = 65001;
    Blob *source = nullptr;
    if (library->CreateBlobWithEncodingFromPinned(text.data(), static_cast<uint32_t>(text.size()), UTF8, &source) < 0)
        return unusable("no blob");
    std::vector<std::wstring> own;
    for (int i = 6; i < count; ++i) own.push_back(wide(arguments[i]));
    std::vector<const wchar_t *> pointers;
    for (const auto &argument : own) pointers.push_back(argument.c_str());
    Outcome *outcome = nullptr;
    const Result called =
        compiler->Compile(source, wide(arguments[2]).c_str(), wide(arguments[3]).c_str(), wide(arguments[4]).c_str(),
                          pointers.data(), static_cast<uint32_t>(pointers.size()), nullptr, 0, nullptr, &outcome);
    if (called < 0 || !outcome) return unusable("Compile was refused");
    Result status = -1;
    outcome->GetStatus(&status);
    Blob *words = nullptr;
    if (outcome->GetErrorBuffer(&words) >= 0 && words)
        std::fwrite(words->GetBufferPointer(), 1, words->GetBufferSize(), stderr);
    if (status < 0) return 1;
    Blob *code = nullptr;
    if (outcome->GetResult(&code) < 0 || !code) return unusable("there is no result");
    std::ofstream out(arguments[5], std::ios::binary);
    out.write(static_cast<const char *>(code->GetBufferPointer()), static_cast<std::streamsize>(code->GetBufferSize()));
    out.close();
    return out ? 0 : unusable("the output cannot be written");
}
