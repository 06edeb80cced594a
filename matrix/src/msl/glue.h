// How a generated program hands a kernel its arguments: what a parameter's type is, the compiler
// tells.
#ifndef MSL_GLUE
#define MSL_GLUE
#include <metal_stdlib>

namespace msl_glue {
template <class F> struct parts;
template <class R, class... A> struct parts<R (*)(A...)> {
    static constexpr int count = sizeof...(A);
    template <int I> using arg = __type_pack_element<I, A...>;
};

// What a reference or pointer refers to.
template <class P> struct target_of {
    static_assert(sizeof(P) == 0, "a buffer must be a reference or a pointer");
};
template <class T> struct target_of<T &> { using type = T; };
template <class T> struct target_of<T *> { using type = T; };
template <class P> using target = typename target_of<P>::type;

template <class P> struct as_argument;
template <class T> struct as_argument<T &> {
    static T &of(void *p) { return *static_cast<T *>(p); }
};
template <class T> struct as_argument<T *> {
    static T *of(void *p) { return static_cast<T *>(p); }
};
template <class P> P memory(void *p) { return as_argument<P>::of(p); }

template <class P> P texture(void *p) { return P(static_cast<msl_texture *>(p)); }
template <class P> P sampler(void *p) { return P(*static_cast<const uint *>(p)); }

// A position or index: a number or several.
template <class P> struct number_of {
    static P of(const uint (&v)[3]) { return P(v[0]); }
};
template <class T> struct number_of<metal::vec<T, 2>> {
    static metal::vec<T, 2> of(const uint (&v)[3]) { return metal::vec<T, 2>(T(v[0]), T(v[1])); }
};
template <class T> struct number_of<metal::vec<T, 3>> {
    static metal::vec<T, 3> of(const uint (&v)[3]) {
        return metal::vec<T, 3>(T(v[0]), T(v[1]), T(v[2]));
    }
};
template <class P> P number(const uint (&v)[3]) { return number_of<P>::of(v); }

template <class P> P vector(const float (&v)[4]) { return P(v[0], v[1], v[2], v[3]); }

// The bytes of a scalar or vector without its padding.
template <class T> struct packed_size { static constexpr size_t value = sizeof(T); };
template <class T, int N> struct packed_size<metal::vec<T, N>> {
    static constexpr size_t value = sizeof(T) * N;
};
// The values of a vertex or fragment are tightly packed.
template <class T> void fetch(T &value, const void *all, const uint (&i)[3]) {
    constexpr size_t size = packed_size<T>::value;
    __builtin_memcpy(&value, static_cast<const char *>(all) + i[0] * size, size);
}
template <class T> void put(const T &value, void *all, const uint (&i)[3]) {
    constexpr size_t size = packed_size<T>::value;
    __builtin_memcpy(static_cast<char *>(all) + i[0] * size, &value, size);
}
} // namespace msl_glue

#endif
