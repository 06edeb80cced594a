// What TypeScript accepts of the modules, and what it refuses.

import { Fn, texture, uniform, uv, vec2, vec4, uint } from 'three/tsl';
import { Texture, Vector4 } from 'three/webgpu';
import * as shadows from './hankel_shadows.tsl.js';
import { mean, middle, ordered } from './hankel_sample.tsl.js';

const map = new Texture();
const strength = uniform(0.1);
export const shadow = Fn(() => {
    const stored = texture(map, uv());
    const moments = shadows.mixBias(stored, shadows.SYMMETRIC_FOUR_FLOAT_TARGET, strength);
    const biased = shadows.mixBias(new Vector4(), moments, 1e-6);
    const least = shadows.hamburgerBound(biased, uv().x.mul(2));
    const bounds = shadows.boundsOfFour(1, vec4(0, 1, 0, 1), least);
    const word = shadows.packTenBits(moments.xyz);
    return shadows.cutLeak(bounds.x, 0.02).add(shadows.unpackTenBits(word).x);
});
export const looked = mean(uint(3), (i) => texture(map, vec2(i.toFloat(), 0)).x);
export const most = ordered(1, uv().x).get('high');
export const half = middle(ordered(0, 1)).x.add(1);
export const api: 1 = shadows.API;
// @ts-expect-error there is no such function
shadows.hamburger;
// @ts-expect-error a depth is no vector
shadows.hamburgerBound(uv(), vec2(0, 0));
// @ts-expect-error what is looked up is a number
mean(uint(3), (i) => vec2(i, i));
// @ts-expect-error moments come first
shadows.hamburgerBound(0.5, vec4(0, 0, 0, 0));
