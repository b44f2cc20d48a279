"""Interpolation of matrices between nodes."""

from __future__ import annotations

from morphcore.jit import entry_kernel


@entry_kernel
def blend(weights, first, nodes, out):
    """Weighted sums of neighbouring nodes: out[k] = sum over i of weights[k, i] nodes[first[k] + i].

    weights : (k, i); first : (k,); nodes : (n, m); out : (k, m). The library's matrix product is avoided
    because its threads would compete with ours over a few hundred kilobytes.
    """
    for k in range(out.shape[0]):
        row = out[k]
        if weights.shape[1] == 4:  # Lagrange's cubic: one pass instead of four, in the same order of sums
            a, b, c, d = weights[k, 0], weights[k, 1], weights[k, 2], weights[k, 3]
            p, q, r, s = nodes[first[k]], nodes[first[k] + 1], nodes[first[k] + 2], nodes[first[k] + 3]
            for m in range(row.size):
                row[m] = a * p[m] + b * q[m] + c * r[m] + d * s[m]
        else:
            for m in range(row.size):
                row[m] = 0.0
            for i in range(weights.shape[1]):
                weight = weights[k, i]
                node = nodes[first[k] + i]
                for m in range(row.size):
                    row[m] += weight * node[m]
